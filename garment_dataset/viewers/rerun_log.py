"""A recording in Rerun: everything on one timeline, in the optical frames of its cameras. Needs the extra ``rerun``."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from garment_dataset.errors import UsageError, require_extra
from garment_dataset.files import whole_file
from garment_dataset.viewers import colors
from garment_dataset.viewers.encoding import color_jpeg, depth_png
from garment_dataset.viewers.frames import DepthFrame, Frames
from garment_dataset.viewers.rerun_layout import blueprint, root_of
from garment_dataset.viewers.rerun_series import log_series

if TYPE_CHECKING:
    import rerun as rr

    from garment_dataset.arrays import DepthImage
    from garment_dataset.viewers.content import Content
    from garment_dataset.viewers.frames import ColorFrame, Points, Pose

TIME = "time"
"""Timeline: seconds since the first usable image of the recording."""

VIEWER = (sys.executable, "-c", "import sys; from rerun_cli.__main__ import main; sys.exit(main())")
"""The command of the viewer that comes with Rerun, wherever that is installed: it need not be on the PATH."""

_TWO_STDS = 2.0
_AXIS_M = 0.08
_MASK_OPACITY, _OVER_IMAGE = 0.35, 1.0
_POINT_M, _CHAIN_M = 0.006, 0.002
_MM_IN_M = 1000.0
_CENTRE_PX = 0.5
"""Where Rerun has the centre of the first pixel; in the tables it is 0."""
_ROOM_MM = 30.0


def import_rerun() -> None:
    """Say so if Rerun is not installed.

    Raises
    ------
    MissingExtraError
        If it is not.
    """
    require_extra("rerun", "the viewer needs Rerun", "rerun")


def save_rrd(content: Content, path: Path) -> None:
    """Write a recording to a file for Rerun, whole or not at all; no screen is needed.

    Parameters
    ----------
    content : Content
        Of the recording.
    path : Path
        The ``.rrd`` file; one that is there is replaced.

    Raises
    ------
    MissingExtraError
        If Rerun is not installed.
    OSError
        If it cannot be written.
    BagError
        If the bag cannot be read.
    """
    import_rerun()
    import rerun as rr

    stream = _new_stream(content)
    # Rerun's own writer may wait for ever when a disk is full: its bytes are kept, compressed, and written here
    kept = rr.binary_stream(stream)
    stream.send_blueprint(blueprint(content, TIME), make_active=False, make_default=True)
    _Log(stream, content).all()
    data = kept.read()
    stream.disconnect()
    with whole_file(path) as part:
        part.write_bytes(data or b"")


def open_viewer(content: Content) -> None:
    """Show a recording in Rerun's viewer; return when that is closed.

    The viewer reads a file that is gone afterwards: a stream to a viewer that does not start would wait for ever.

    Parameters
    ----------
    content : Content
        Of the recording.

    Raises
    ------
    MissingExtraError
        If Rerun is not installed.
    UsageError
        If the viewer does not start.
    BagError
        If the bag cannot be read.
    """
    with TemporaryDirectory(prefix="garment-view-") as folder:
        path = Path(folder) / f"{content.recording}.rrd"
        save_rrd(content, path)
        command = [*VIEWER, "--bind", "127.0.0.1", str(path)]  # by default it would listen on the network
        done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - Rerun's own
    if done.returncode:
        found = next(iter(done.stderr.splitlines()[-1:]), f"exit code {done.returncode}")
        raise UsageError("the viewer does not start", found=found, hint="--save FILE.rrd needs no screen.")


def _new_stream(content: Content) -> rr.RecordingStream:
    import rerun as rr

    stream = rr.RecordingStream("garment-dataset", recording_id=content.recording)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.send_recording_name(content.recording)
    stream.send_recording_start_time_nanos(content.start_ns)
    return stream


class _Log:
    """One recording on its way into Rerun."""

    def __init__(self, stream: rr.RecordingStream, content: Content) -> None:
        self._stream, self._content = stream, content
        self._range_mm = _range_mm(content)
        self._camera = {name: root_of(camera) for name, camera in content.cameras.items()}

    def all(self) -> None:
        """Send what holds all along, then the series, then frame after frame."""
        self._log_cameras()
        log_series(self._stream, self._content, TIME)
        for frame in Frames(self._content):
            stamp_ns = np.int64(frame.stamp_ns)
            self._stream.set_time(TIME, duration=np.timedelta64(int(stamp_ns - self._content.start_ns), "ns"))
            number = int(self._content.main_frames(np.array([stamp_ns]))[0])
            self._stream.set_time(f"{self._content.main}_frame", sequence=number)
            if isinstance(frame, DepthFrame):
                self._log_depth(frame)
            else:
                self._log_color(frame)

    def _send(self, path: str, *what: rr.AsComponents, static: bool = False) -> None:
        self._stream.log(path, *what, static=static, strict=True)

    def _log_cameras(self) -> None:
        import rerun as rr

        for stream, camera in self._content.cameras.items():
            root = self._camera[stream]
            self._send(root, rr.ViewCoordinates.RDF, static=True)
            between = self._content.other_in_main
            if between is not None and root != self._camera[self._content.main]:
                turn = rr.Quaternion(xyzw=between.quaternion_xyzw.tolist())
                place = rr.Transform3D(translation=between.translation, quaternion=turn)
                self._send(root, place, static=True)
            k = camera.intrinsics
            rows = [[k.fx_px, 0.0, k.cx_px + _CENTRE_PX], [0.0, k.fy_px, k.cy_px + _CENTRE_PX], [0.0, 0.0, 1.0]]
            pinhole = rr.Pinhole(
                image_from_camera=np.array(rows),
                resolution=[camera.width_px, camera.height_px],
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=0.3,
            )
            self._send(f"{root}/{stream}_image", pinhole, static=True)

    def _log_depth(self, frame: DepthFrame) -> None:
        import rerun as rr

        root = self._camera["depth"]
        if frame.depth_mm is not None:
            self._log_depths(f"{root}/depth_image/depth_mm", frame.depth_mm)
            seen = np.zeros_like(frame.depth_mm) if frame.mask is None else frame.depth_mm * frame.mask
            self._log_depths(f"{root}/depth_image/garment_mm", seen)
        tables = self._content.tables
        if "chains" in tables:
            strips = [frame.chain_m] if len(frame.chain_m) else []
            self._send(f"{root}/chain_m", rr.LineStrips3D(strips, colors=[colors.CHAIN], radii=[_CHAIN_M]))
        for name, points in (("points", frame.points), ("tracks", frame.tracks)):
            if name in tables:
                self._log_points(f"{root}/{name}", points)
        self._log_gripper(root, "depth", frame.gripper)

    def _log_depths(self, path: str, depth_mm: DepthImage) -> None:
        import rerun as rr

        image = rr.EncodedDepthImage(
            depth_png(depth_mm),
            media_type="image/png",
            meter=_MM_IN_M,
            colormap="viridis",
            depth_range=self._range_mm,
        )
        self._send(path, image)

    def _log_points(self, path: str, points: Points) -> None:
        import rerun as rr

        shades = [colors.point_color(int(number)) for number in points.number]
        labels = [f"{number}" for number in points.number]
        self._send(f"{path}_m", rr.Points3D(points.position_m, colors=shades, labels=labels, radii=[_POINT_M]))
        known = np.isfinite(points.std_m).all(axis=1)
        around = rr.Ellipsoids3D(
            centers=points.position_m[known],
            half_sizes=_TWO_STDS * points.std_m[known],
            colors=[shades[row] for row in np.flatnonzero(known)],
        )
        self._send(f"{path}_2_std_m", around)

    def _log_gripper(self, root: str, stream: str, gripper: Pose | None) -> None:
        import rerun as rr

        end_m = np.empty((0, 3)) if gripper is None else gripper.position_m[None]
        path = f"{root}/{stream}_gripper"
        self._send(f"{path}/end_point_m", rr.Points3D(end_m, colors=[colors.GRIPPER], radii=[_POINT_M]))
        if gripper is None or gripper.quaternion_xyzw is None:
            self._send(f"{path}/frame", rr.Clear(recursive=False))
            return
        place = rr.Transform3D(
            translation=gripper.position_m, quaternion=rr.Quaternion(xyzw=gripper.quaternion_xyzw.tolist())
        )
        self._send(f"{path}/frame", place, rr.TransformAxes3D(_AXIS_M))

    def _log_color(self, frame: ColorFrame) -> None:
        import rerun as rr

        root = self._camera["color"]
        image = f"{root}/color_image"
        if frame.rgb is not None:
            self._send(f"{image}/rgb", rr.EncodedImage(contents=color_jpeg(frame.rgb), media_type="image/jpeg"))
        if "silhouettes" in self._content.tables:
            self._log_mask(f"{image}/mask", frame.mask_png)
            strips = [frame.outline_px + _CENTRE_PX] if len(frame.outline_px) else []
            self._send(f"{image}/outline_px", rr.LineStrips2D(strips, colors=[colors.OUTLINE]))
        if "central_curves" in self._content.tables:
            strips = [frame.curve_px + _CENTRE_PX] if len(frame.curve_px) else []
            self._send(f"{image}/central_curve_px", rr.LineStrips2D(strips, colors=[colors.CURVE]))
        self._log_gripper(root, "color", frame.gripper)

    def _log_mask(self, path: str, mask_png: bytes | None) -> None:
        """Log the silhouette over the image: the garment is lighter, the rest darker."""
        import rerun as rr

        if mask_png is None:
            self._send(path, rr.Clear(recursive=False))
        else:
            image = rr.EncodedImage(
                contents=mask_png, media_type="image/png", opacity=_MASK_OPACITY, draw_order=_OVER_IMAGE
            )
            self._send(path, image)


def _range_mm(content: Content) -> tuple[float, float]:
    """Return the depths between which colour changes: the garment's own, or those that it can have."""
    if "chains" in content.tables and len(content.tables["chains"]):
        z_mm, room_mm = content.tables["chains"]["z_m"] * _MM_IN_M, _ROOM_MM
    else:
        z_mm = content.tables["gripper"].query("stream == 'depth'")["z_m"].dropna() * _MM_IN_M
        room_mm = content.mask.band_half_width_m * _MM_IN_M
    return (float(z_mm.min()) - room_mm, float(z_mm.max()) + room_mm) if len(z_mm) else (_ROOM_MM, 4000.0)
