"""What of the world may not be read in a stage's reach, since no key holds it: names of the libraries that tell it."""

from __future__ import annotations

from garment_dataset.engine.errors import UntraceableCodeError

_PARAMETER = "Make it a parameter of the stage"
_RECORDED = "Take times from an input, or make it a parameter of the stage"
_SEEDED = "Use a generator of your own with a seed that is a constant or a parameter: numpy.random.default_rng(seed)"
_INPUT = "Make it an input of the stage: a source, or a table of another stage"
_NAMED = "Name things by what they are: subject, frame, content"
_STABLE = "Python varies it from run to run: use hashlib, or the value itself"
_SCRATCH = "Keep it in memory, or in tempfile.TemporaryFile(), which has no name"
_ELSEWHERE = "Do it before the build, and make what it gives an input or a parameter"

_BY_HINT = {
    _PARAMETER: """
        os.environ os.environb os.getenv os.getenvb os.putenv os.unsetenv os.path.expanduser os.path.expandvars
        os.getcwd os.getcwdb os.chdir os.cpu_count os.process_cpu_count os.sched_getaffinity os.uname os.getlogin
        os.get_exec_path os.ctermid os.get_terminal_size os.getloadavg os.sysconf os.umask builtins.input sys.argv
        sys.orig_argv sys.stdin sys.executable sys.path sys.prefix sys.base_prefix sys.exec_prefix
        sys.base_exec_prefix sys.getwindowsversion platform getpass locale site sysconfig pwd grp resource argparse
        fileinput multiprocessing.cpu_count pathlib.Path.cwd pathlib.Path.home pathlib.PosixPath.cwd
        pathlib.PosixPath.home shutil.which shutil.disk_usage shutil.get_terminal_size psutil
    """,
    _RECORDED: """
        time datetime.datetime.now datetime.datetime.today datetime.datetime.utcnow datetime.date.today timeit sched
        cv2.getTickCount cv2.getCPUTickCount pandas.Timestamp.now pandas.Timestamp.today pandas.Timestamp.utcnow
        os.times email.utils.localtime email.utils.formatdate
    """,
    _SEEDED: """
        random numpy.random secrets os.urandom os.getrandom uuid.uuid1 uuid.uuid4 cv2.randu cv2.randn cv2.randShuffle
        cv2.theRNG
    """,
    _NAMED: """
        os.getpid os.getppid os.getpgid os.getuid os.geteuid os.getgid os.gettid threading.get_ident
        threading.get_native_id threading.current_thread threading.main_thread threading.active_count
        threading.enumerate multiprocessing.current_process uuid.getnode
    """,
    _ELSEWHERE: """
        socket ssl urllib.request urllib.urlopen http requests urllib3 httpx aiohttp ftplib smtplib poplib imaplib
        xmlrpc socketserver websockets subprocess os.system os.popen os.fork os.forkpty os.execv os.execve os.execvp
        os.execvpe os.execl os.execle os.execlp os.execlpe os.spawnv os.spawnve os.spawnl os.spawnle os.posix_spawn
        os.posix_spawnp os.startfile os.kill pty webbrowser asyncio.create_subprocess_exec
        asyncio.create_subprocess_shell asyncio.open_connection paramiko boto3
    """,
    _SCRATCH: "tempfile",
    _STABLE: "builtins.hash",
}
_REFUSED = {name: hint for hint, names in _BY_HINT.items() for name in names.split()}

_SEEDED_CALLS = frozenset(
    ["random.Random"]
    + [
        f"numpy.random.{name}"
        for name in ("default_rng", "SeedSequence", "RandomState", "PCG64", "PCG64DXSM", "MT19937", "Philox", "SFC64")
    ]
)
"""Generators and what makes them: fine with a seed."""

_ALLOWED = frozenset({"numpy.random.Generator", "numpy.random.BitGenerator", "http.HTTPStatus"}) | {
    "tempfile.TemporaryFile",
    "tempfile.SpooledTemporaryFile",
    "time.sleep",
}
_IN_ERRORS = frozenset({"tempfile.gettempdir"})
"""May be named in a ``raise``, where it tells a user where there is no room."""

_NOT_HANDED_ON = frozenset({"os", "sys", "time", "random", "datetime", "pathlib", "io", "shutil", "builtins", "uuid"})
"""Modules that tell of the world, which may only stand before a dot."""

_MOMENTS = frozenset({"now", "today"})
_OF_MOMENTS = frozenset({"numpy.datetime64", "pandas.Timestamp", "pandas.to_datetime"})


def world_refusal(
    dotted: str, *, is_called: bool, is_raised: bool, function: str | None
) -> UntraceableCodeError | None:
    """Return why something external may not be used in reach, or None when it may.

    Parameters
    ----------
    dotted : str
        What is used.
    is_called : bool
        Whether it is called there; then :func:`call_refusal` looks at its arguments.
    is_raised : bool
        Whether it stands in a ``raise``.
    function : str or None
        Name of the function around.
    """
    if dotted in _NOT_HANDED_ON:
        return UntraceableCodeError(
            "a module that tells of the world is handed on as a value", found=dotted, hint="Write module.name"
        )
    is_seeded = dotted in _SEEDED_CALLS and (is_called or dotted.rpartition(".")[2][0].isupper())
    is_own_hash = dotted == "builtins.hash" and function == "__hash__"
    if is_seeded or is_own_hash or is_allowed(dotted) or (dotted in _IN_ERRORS and is_raised):
        return None
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        if (refused := ".".join(parts[:count])) in _REFUSED:
            return reads_the_world(dotted, _REFUSED[refused])
    return None


def is_allowed(dotted: str) -> bool:
    """Say whether something is allowed whatever stands around it, in a module that tells of the world."""
    return any(f"{dotted}.".startswith(f"{each}.") for each in _ALLOWED)


def call_refusal(dotted: str, arguments: list[object], *, has_more: bool) -> UntraceableCodeError | None:
    """Return why something external may not be called with these arguments, or None when it may.

    Parameters
    ----------
    dotted : str
        What is called.
    arguments : list of object
        Its arguments in order, those by keyword too: the value of a constant, ``...`` for anything else.
    has_more : bool
        Whether arguments are unpacked as well.
    """
    if dotted in _SEEDED_CALLS and not has_more and (not arguments or arguments[0] is None):
        return reads_the_world(f"{dotted}() without a seed", _SEEDED)
    if dotted in _OF_MOMENTS and arguments and arguments[0] in _MOMENTS:
        return reads_the_world(f"{dotted}({arguments[0]!r})", _RECORDED)
    if dotted.endswith("datetime.fromtimestamp") and len(arguments) == 1 and not has_more:
        return reads_the_world(f"{dotted}() in local time", "Give it a time zone: datetime.UTC")
    return None


def reads_the_world(found: str, hint: str) -> UntraceableCodeError:
    """Return the refusal of something that depends on more than code, parameters and inputs."""
    return UntraceableCodeError(
        "a stage's result may not depend on it", found=found.removeprefix("builtins."), hint=hint
    )


def unnamed_file(found: str) -> UntraceableCodeError:
    """Return the refusal of a file whose path does not come from what the function was given."""
    return UntraceableCodeError(
        "a file that is no declared input",
        expected="a path made from an argument of the function",
        found=found.removeprefix("builtins."),
        hint=_INPUT,
    )


_FILE_CALLS = """
builtins.open io.open io.open_code io.FileIO os.open os.listdir os.walk os.fwalk os.scandir os.stat os.lstat os.access
os.readlink os.path.exists os.path.lexists os.path.isfile os.path.isdir os.path.islink os.path.ismount os.path.getsize
os.path.getmtime os.path.getctime os.path.getatime os.path.samefile os.path.realpath os.path.abspath os.statvfs
os.remove os.unlink os.rename os.replace os.mkdir os.makedirs os.rmdir os.removedirs os.link os.symlink os.truncate
os.utime os.chmod os.chown os.mkfifo os.getxattr os.listxattr
glob.glob glob.iglob shutil.copy shutil.copy2 shutil.copyfile shutil.copytree shutil.move shutil.rmtree
shutil.make_archive shutil.unpack_archive linecache.getline linecache.getlines tokenize.open codecs.open
numpy.load numpy.loadtxt numpy.fromfile numpy.genfromtxt numpy.memmap numpy.fromregex numpy.DataSource
numpy.lib.format.open_memmap numpy.save numpy.savez numpy.savez_compressed numpy.savetxt
cv2.imread cv2.imreadmulti cv2.imcount cv2.imwrite cv2.VideoCapture cv2.VideoWriter cv2.FileStorage
cv2.CascadeClassifier cv2.haveImageReader cv2.dnn.readNet cv2.dnn.readNetFromONNX cv2.dnn.readNetFromCaffe
cv2.samples.findFile
pandas.read_csv pandas.read_table pandas.read_fwf pandas.read_excel pandas.read_json pandas.read_html pandas.read_xml
pandas.read_hdf pandas.read_feather pandas.read_parquet pandas.read_orc pandas.read_sas pandas.read_spss
pandas.read_stata pandas.read_pickle pandas.read_clipboard pandas.HDFStore pandas.ExcelFile pandas.ExcelWriter
polars.read_csv polars.read_parquet polars.read_json polars.read_ipc polars.scan_csv polars.scan_parquet
pyarrow.memory_map pyarrow.OSFile pyarrow.input_stream pyarrow.output_stream pyarrow.create_memory_map
pyarrow.parquet.read_table pyarrow.parquet.read_pandas pyarrow.parquet.read_schema pyarrow.parquet.read_metadata
pyarrow.parquet.ParquetFile pyarrow.parquet.ParquetDataset pyarrow.parquet.ParquetWriter pyarrow.csv.read_csv
pyarrow.csv.open_csv pyarrow.json.read_json pyarrow.feather.read_table pyarrow.feather.read_feather
pyarrow.orc.read_table pyarrow.dataset.dataset pyarrow.dataset.parquet_dataset
pyarrow.ipc.open_file pyarrow.ipc.open_stream
sqlite3.connect duckdb.connect duckdb.read_csv duckdb.read_parquet dbm.open shelve.open zipfile.ZipFile
zipfile.is_zipfile zipfile.Path tarfile.open tarfile.TarFile tarfile.is_tarfile gzip.open gzip.GzipFile bz2.open
bz2.BZ2File lzma.open lzma.LZMAFile lz4.frame.open zstandard.open
xml.etree.ElementTree.parse xml.dom.minidom.parse PIL.Image.open imageio.imread imageio.v2.imread imageio.v3.imread
skimage.io.imread matplotlib.pyplot.imread matplotlib.image.imread scipy.io.loadmat scipy.io.wavfile.read h5py.File
joblib.load torch.load soundfile.read netCDF4.Dataset xarray.open_dataset
"""
FILE_CALLS = frozenset(_FILE_CALLS.split())
"""Calls whose first argument names a file."""

_PATH_METHODS = """
open read_text read_bytes iterdir glob rglob exists is_file is_dir is_symlink is_mount stat lstat walk readlink samefile
resolve absolute write_text write_bytes mkdir unlink touch rmdir rename symlink_to hardlink_to chmod
"""
PATH_METHODS = frozenset(_PATH_METHODS.split())
"""Methods of paths that look at the file system, or change it."""

PATH_CLASSES = frozenset({"pathlib.Path", "pathlib.PosixPath", "pathlib.WindowsPath"})

_WRITING = "to_csv to_parquet to_json to_excel to_feather to_hdf to_pickle to_sql to_html to_stata tofile savefig"
WRITING_METHODS = frozenset(_WRITING.split())
"""Methods of tables and arrays whose first argument names a file."""

FIRST_DECIDES = frozenset({"builtins.str", "os.fspath", "os.fsdecode", "os.fsencode"})
"""Calls that give the path that they are given; those of ``pathlib`` and ``os.path`` do so, too."""


def names_a_file(dotted: str) -> bool:
    """Say whether something external is a function whose first argument names a file."""
    head, _, method = dotted.rpartition(".")
    return dotted in FILE_CALLS or (head in PATH_CLASSES and method in PATH_METHODS)
