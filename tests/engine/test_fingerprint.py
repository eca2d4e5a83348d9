"""Laws of the code fingerprint: which edits change it, which do not, and what it refuses to follow."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import garment_dataset
from garment_dataset.engine.fingerprint import CodeBase, Fingerprint, changed_parts, fingerprint, library_versions
from garment_dataset.errors import UntraceableCodeError

PACKAGE = Path(garment_dataset.__file__).parent


def write(folder: Path, text: str) -> Path:
    """Write a package from one text: ``--- name.py`` begins a file, what comes before belongs to ``m.py``."""
    package = folder / "pkg"
    shutil.rmtree(package, ignore_errors=True)
    _, *rest = re.split(r"^--- (\S+)(?:\n|\Z)", f"--- m.py\n{text}", flags=re.MULTILINE)
    for name, source in {"__init__.py": "", **dict(zip(rest[::2], rest[1::2], strict=True))}.items():
        path = package / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source, "utf-8")
    return package


def of(folder: Path, text: str, **options: tuple[str, ...]) -> Fingerprint:
    """Return the fingerprint of ``f`` in ``m.py`` of a package written from ``text``."""
    return fingerprint("pkg.m:f", roots={"pkg": write(folder, text)}, **options)


# each: what is edited, before, after
CHANGES = [
    ("an operator", "def f(a): return a + 1", "def f(a): return a - 1"),
    ("a comparison", "def f(a): return a < 1", "def f(a): return a <= 1"),
    ("an integer", "def f(): return 1", "def f(): return 2"),
    ("1 to 1.0", "def f(): return 1", "def f(): return 1.0"),
    ("1 to True", "def f(): return 1", "def f(): return True"),
    ("1 to its text", "def f(): return 1", "def f(): return '1'"),
    ("text to bytes", "def f(): return 'a'", "def f(): return b'a'"),
    ("None to nothing", "def f(a): return a[None:]", "def f(a): return a[:]"),
    ("None to ...", "def f(): return None", "def f(): return ..."),
    ("the sign of zero", "def f(): return 0.0", "def f(): return -0.0"),
    ("a last digit", "def f(): return 0.1", "def f(): return 0.10000000000000002"),
    ("an imaginary zero", "def f(): return 0j", "def f(): return 0"),
    ("a singleton pattern", "def f(a):\n match a:\n  case None: return 1", "def f(a):\n match a:\n  case True: return 1"),
    ("the order of statements", "def f(a):\n a += 1\n a *= 2\n return a", "def f(a):\n a *= 2\n a += 1\n return a"),
    ("two locals swapped in use", "def f(a):\n x = a\n y = 1\n return x - y", "def f(a):\n x = a\n y = 1\n return y - x"),
    ("a local to a parameter", "def f(a):\n x = 1\n return x", "def f(a):\n x = 1\n return a"),
    ("a local to a global", "X = 1\ndef f():\n X = 2\n return X", "X = 1\ndef f():\n Y = 2\n return X"),
    ("a closure to a local", "def f():\n x = 1\n def g():\n  x = 2\n  return x\n return g() + x",
     "def f():\n x = 1\n def g():\n  nonlocal x\n  x = 2\n  return x\n return g() + x"),
    ("which loop a name comes from", "def f(a): return [x + y for x in a for y in a]",
     "def f(a): return [x + x for x in a for y in a]"),
    ("a default", "def f(a=1): return a", "def f(a=2): return a"),
    ("a keyword-only default", "def f(*, a=1): return a", "def f(*, a=2): return a"),
    ("whether a parameter is keyword-only", "def f(a, b=1): return b", "def f(a, *, b=1): return b"),
    ("the name of a parameter", "def f(a): return a", "def f(b): return b"),
    ("an annotation", "def f(a: int): return a", "def f(a: float): return a"),
    ("a keyword of a call", "def f(g): return g(a=1)", "def f(g): return g(b=1)"),
    ("an attribute", "def f(a): return a.x", "def f(a): return a.y"),
    ("a decorator added", "import functools\ndef f(): pass", "import functools\n@functools.cache\ndef f(): pass"),
    ("the order of decorators", "def a(g): return g\ndef b(g): return g\n@a\n@b\ndef f(): pass",
     "def a(g): return g\ndef b(g): return g\n@b\n@a\ndef f(): pass"),
    ("text in an f-string", "def f(a): return f'a{a}'", "def f(a): return f'b{a}'"),
    ("the format in an f-string", "def f(a): return f'{a:.1f}'", "def f(a): return f'{a:.2f}'"),
    ("the conversion in an f-string", "def f(a): return f'{a!r}'", "def f(a): return f'{a!s}'"),
    ("async", "def f(): pass", "async def f(): pass"),
    ("the else of a loop", "def f(a):\n for x in a: pass\n else: return 1", "def f(a):\n for x in a: pass\n return 1"),
    ("except to except*", "def f():\n try: pass\n except ValueError: pass", "def f():\n try: pass\n except* ValueError: pass"),
    ("a helper", "def g(): return 1\ndef f(): return g()", "def g(): return 2\ndef f(): return g()"),
    ("a helper two calls away", "from pkg.a import g\ndef f(): return g()\n--- a.py\nfrom pkg.b import h\ndef g(): return h()"
     "\n--- b.py\ndef h(): return 1",
     "from pkg.a import g\ndef f(): return g()\n--- a.py\nfrom pkg.b import h\ndef g(): return h()\n--- b.py\ndef h(): return 2"),
    ("a constant", "X = 1\ndef f(): return X", "X = 2\ndef f(): return X"),
    ("a constant that a constant is made of", "Y = 1\nX = (Y,)\ndef f(): return X", "Y = 2\nX = (Y,)\ndef f(): return X"),
    ("a constant unpacked", "X, Y = 1, 2\ndef f(): return Y", "X, Y = 1, 3\ndef f(): return Y"),
    ("an annotated constant", "X: int = 1\ndef f(): return X", "X: int = 2\ndef f(): return X"),
    ("what a default refers to", "X = 1\ndef f(a=X): return a", "X = 2\ndef f(a=X): return a"),
    ("a constant redefined", "X = 1\ndef f(): return X", "X = 1\nX = 2\ndef f(): return X"),
    ("a constant deleted", "X = 1\ndef f(): return X", "X = 1\ndel X\ndef f(): return X"),
    ("a constant increased", "X = 1\nX += 1\ndef f(): return X", "X = 1\nX += 2\ndef f(): return X"),
    ("a list appended to", "X = []\ndef f(): return X", "X = []\nX.append(1)\ndef f(): return X"),
    ("an item set", "X = {}\nX['a'] = 1\ndef f(): return X", "X = {}\nX['a'] = 2\ndef f(): return X"),
    ("an inner item set", "X = {'a': {}}\nX['a']['b'] = 1\ndef f(): return X", "X = {'a': {}}\nX['a']['b'] = 2\ndef f(): return X"),
    ("an attribute set", "def f(): return f.x\nf.x = 1", "def f(): return f.x\nf.x = 2"),
    ("a loop that binds", "for X in (1, 2): pass\ndef f(): return X", "for X in (1, 3): pass\ndef f(): return X"),
    ("a loop that fills", "X = []\nfor i in range(2): X.append(i)\ndef f(): return X",
     "X = []\nfor i in range(3): X.append(i)\ndef f(): return X"),
    ("a condition that binds", "import sys\nif sys.argv: X = 1\nelse: X = 2\ndef f(): return X",
     "import sys\nif sys.argv: X = 1\nelse: X = 3\ndef f(): return X"),
    ("a try that binds", "try: X = 1\nexcept ValueError: X = 2\ndef f(): return X", "try: X = 1\nexcept TypeError: X = 2\ndef f(): return X"),
    ("a with that binds", "with open('a') as X: pass\ndef f(): return X", "with open('b') as X: pass\ndef f(): return X"),
    ("a walrus that binds", "Y = (X := 1)\ndef f(): return X", "Y = (X := 2)\ndef f(): return X"),
    ("the order of definition and early binding", "X = 1\nY = X\nX = 2\ndef f(): return Y", "X = 1\nX = 2\nY = X\ndef f(): return Y"),
    ("the order of change and early binding", "X = [1]\nY = tuple(X)\nX.append(2)\ndef f(): return Y",
     "X = [1]\nX.append(2)\nY = tuple(X)\ndef f(): return Y"),
    ("the order of definition and call", "X = 1\ndef g(): return X\nY = g()\nX = 2\ndef f(): return Y",
     "X = 1\ndef g(): return X\nX = 2\nY = g()\ndef f(): return Y"),
    ("a function redefined", "def g(): return 1\ndef f(): return g()", "def g(): return 1\ndef g(): return 2\ndef f(): return g()"),
    ("a name of a function in reach", "def g(): return 1\ndef f(): return g()", "def h(): return 1\ndef f(): return h()"),
    ("an effect", "import numpy as np\ndef f(): return 1", "import numpy as np\nnp.seterr(all='raise')\ndef f(): return 1"),
    ("an effect in a condition", "import sys, cv2\nif sys.argv: cv2.setNumThreads(1)\ndef f(): return 1",
     "import sys, cv2\nif sys.argv: cv2.setNumThreads(2)\ndef f(): return 1"),
    ("an effect whose result goes nowhere", "import numpy as np\n_old = np.seterr(all='raise')\ndef f(): return 1",
     "import numpy as np\n_old = np.seterr(all='warn')\ndef f(): return 1"),
    ("what an effect refers to", "import numpy as np\nHOW = 'raise'\nnp.seterr(all=HOW)\ndef f(): return 1",
     "import numpy as np\nHOW = 'warn'\nnp.seterr(all=HOW)\ndef f(): return 1"),
    ("an effect of a module of the reach", "from pkg.a import g\ndef f(): return g()\n--- a.py\ndef g(): return 1",
     "from pkg.a import g\ndef f(): return g()\n--- a.py\nprint(1)\ndef g(): return 1"),
    ("an effect of a package", "def f(): return 1", "def f(): return 1\n--- __init__.py\nimport numpy as np\nnp.seterr(all='raise')"),
    ("an effect of a module imported for it", "import pkg.a\ndef f(): return 1\n--- a.py\nprint(1)", "import pkg.a\ndef f(): return 1\n--- a.py\nprint(2)"),
    ("an effect of a module imported in a function", "def f():\n import pkg.a\n--- a.py\nprint(1)", "def f():\n import pkg.a\n--- a.py\nprint(2)"),
    ("the order of effects", "print(1)\nprint(2)\ndef f(): pass", "print(2)\nprint(1)\ndef f(): pass"),
    ("the order of effects of modules", "import pkg.a\nimport pkg.b\ndef f(): pass\n--- a.py\nprint(1)\n--- b.py\nprint(2)",
     "import pkg.b\nimport pkg.a\ndef f(): pass\n--- a.py\nprint(1)\n--- b.py\nprint(2)"),
    ("the order of effect and value", "import numpy as np\nX = np.divide(1, 0)\nnp.seterr(all='raise')\ndef f(): return X",
     "import numpy as np\nnp.seterr(all='raise')\nX = np.divide(1, 0)\ndef f(): return X"),
    ("a method", "class C:\n def g(self): return 1\ndef f(): return C()", "class C:\n def g(self): return 2\ndef f(): return C()"),
    ("a base class", "class B:\n x = 1\nclass C(B): pass\ndef f(): return C()", "class B:\n x = 2\nclass C(B): pass\ndef f(): return C()"),
    ("the order of bases", "class A: pass\nclass B: pass\nclass C(A, B): pass\ndef f(): return C",
     "class A: pass\nclass B: pass\nclass C(B, A): pass\ndef f(): return C"),
    ("a metaclass", "class M(type):\n x = 1\nclass C(metaclass=M): pass\ndef f(): return C", "class M(type):\n x = 2\nclass C(metaclass=M): pass\ndef f(): return C"),
    ("a class attribute", "class C:\n x = 1\ndef f(): return C.x", "class C:\n x = 2\ndef f(): return C.x"),
    ("a class attribute named like a global", "X = 1\nclass C:\n X = X\ndef f(): return C.X", "X = 2\nclass C:\n X = X\ndef f(): return C.X"),
    ("the class of a parameter", "class C:\n def g(self): return 1\ndef f(a: C): return a.g()", "class C:\n def g(self): return 2\ndef f(a: C): return a.g()"),
    ("the class named in a string", "class C:\n def g(self): return 1\ndef f(a: 'C | None'): return a.g()",
     "class C:\n def g(self): return 2\ndef f(a: 'C | None'): return a.g()"),
    ("a class imported for checkers", "from __future__ import annotations\nfrom typing import TYPE_CHECKING\nif TYPE_CHECKING:\n from pkg.a import C\n"
     "def f(a: C): return a.g()\n--- a.py\nclass C:\n def g(self): return 1",
     "from __future__ import annotations\nfrom typing import TYPE_CHECKING\nif TYPE_CHECKING:\n from pkg.a import C\n"
     "def f(a: C): return a.g()\n--- a.py\nclass C:\n def g(self): return 2"),
    ("a dataclass field", "from dataclasses import dataclass\n@dataclass\nclass C:\n x: int = 1\ndef f(): return C()",
     "from dataclasses import dataclass\n@dataclass\nclass C:\n x: int = 2\ndef f(): return C()"),
    ("a member of an enum", "import enum\nclass C(enum.Enum):\n X = 1\ndef f(): return C.X", "import enum\nclass C(enum.Enum):\n X = 2\ndef f(): return C.X"),
    ("a function in a table", "def g(): return 1\nT = {'g': g}\ndef f(a): return T[a]()", "def g(): return 2\nT = {'g': g}\ndef f(a): return T[a]()"),
    ("a function in a partial", "from functools import partial\ndef g(a): return 1\nh = partial(g, 1)\ndef f(): return h()",
     "from functools import partial\ndef g(a): return 2\nh = partial(g, 1)\ndef f(): return h()"),
    ("a lambda", "g = lambda a: a + 1\ndef f(): return g(1)", "g = lambda a: a + 2\ndef f(): return g(1)"),
    ("a nested function", "def f():\n def g(): return 1\n return g()", "def f():\n def g(): return 2\n return g()"),
    ("a module used by attribute", "import pkg.a as m\ndef f(): return m.g()\n--- a.py\ndef g(): return 1", "import pkg.a as m\ndef f(): return m.g()\n--- a.py\ndef g(): return 2"),
    ("a module used by its full name", "import pkg.s.a\ndef f(): return pkg.s.a.g()\n--- s/__init__.py\n--- s/a.py\ndef g(): return 1",
     "import pkg.s.a\ndef f(): return pkg.s.a.g()\n--- s/__init__.py\n--- s/a.py\ndef g(): return 2"),
    ("a submodule imported from its package", "from pkg.s import a\ndef f(): return a.g()\n--- s/__init__.py\n--- s/a.py\ndef g(): return 1",
     "from pkg.s import a\ndef f(): return a.g()\n--- s/__init__.py\n--- s/a.py\ndef g(): return 2"),
    ("a relative import", "from . import a\nfrom .b import h\ndef f(): return a.g() + h()\n--- a.py\ndef g(): return 1\n--- b.py\ndef h(): return 1",
     "from . import a\nfrom .b import h\ndef f(): return a.g() + h()\n--- a.py\ndef g(): return 1\n--- b.py\ndef h(): return 2"),
    ("an import in a function", "def f():\n from pkg.a import g\n return g()\n--- a.py\ndef g(): return 1", "def f():\n from pkg.a import g\n return g()\n--- a.py\ndef g(): return 2"),
    ("a re-export", "from pkg import g\ndef f(): return g()\n--- __init__.py\nfrom pkg.a import g\n--- a.py\ndef g(): return 1",
     "from pkg import g\ndef f(): return g()\n--- __init__.py\nfrom pkg.a import g\n--- a.py\ndef g(): return 2"),
    ("a re-export of another function", "from pkg import g\ndef f(): return g()\n--- __init__.py\nfrom pkg.a import g\n--- a.py\ndef g(): return 1\ndef h(): return 2",
     "from pkg import g\ndef f(): return g()\n--- __init__.py\nfrom pkg.a import h as g\n--- a.py\ndef g(): return 1\ndef h(): return 2"),
    ("which function an import gives", "from numpy import sum as g\ndef f(a): return g(a)", "from numpy import max as g\ndef f(a): return g(a)"),
    ("two imports swapped", "from pkg.a import g as p, h as q\ndef f(): return p() - q()\n--- a.py\ndef g(): return 1\ndef h(): return 2",
     "from pkg.a import h as p, g as q\ndef f(): return p() - q()\n--- a.py\ndef g(): return 1\ndef h(): return 2"),
    ("a library in a guarded import", "try: import cv2\nexcept ImportError: cv2 = None\ndef f(): return cv2", "try: import cv3 as cv2\nexcept ImportError: cv2 = None\ndef f(): return cv2"),
    ("what a guarded import tells", "try:\n import cv2\n OK = True\nexcept ImportError: OK = False\ndef f(): return OK",
     "try:\n import cv3\n OK = True\nexcept ImportError: OK = False\ndef f(): return OK"),
    ("a registering function", "T = {}\ndef r(g):\n T[g.__name__] = g\n return g\n@r\ndef a(): return 1\ndef f(k): return T[k]()",
     "T = {}\ndef r(g):\n T[g.__name__] = g\n return g\n@r\ndef a(): return 2\ndef f(k): return T[k]()"),
    ("a function registered more", "T = {}\ndef r(g):\n T[g.__name__] = g\n return g\n@r\ndef a(): return 1\ndef f(k): return T[k]()",
     "T = {}\ndef r(g):\n T[g.__name__] = g\n return g\n@r\ndef a(): return 1\n@r\ndef b(): return 1\ndef f(k): return T[k]()"),
    ("what another module registers", "import pkg.a\nfrom pkg.r import T\ndef f(k): return T[k]()\n--- r.py\nT = {}\ndef r(n):\n def s(g):\n  T[n] = g\n  return g\n return s\n"
     "--- a.py\nfrom pkg.r import r\n@r('a')\ndef a(): return 1",
     "import pkg.a\nfrom pkg.r import T\ndef f(k): return T[k]()\n--- r.py\nT = {}\ndef r(n):\n def s(g):\n  T[n] = g\n  return g\n return s\n"
     "--- a.py\nfrom pkg.r import r\n@r('a')\ndef a(): return 2"),
    ("a single dispatch", "from functools import singledispatch\n@singledispatch\ndef g(a): return 0\n@g.register\ndef _(a: int): return 1\ndef f(a): return g(a)",
     "from functools import singledispatch\n@singledispatch\ndef g(a): return 0\n@g.register\ndef _(a: int): return 2\ndef f(a): return g(a)"),
    ("a subclass that registers itself", "class B:\n T = []\n def __init_subclass__(cls): cls.T.append(cls)\nclass C(B):\n x = 1\ndef f(): return [c.x for c in B.T]",
     "class B:\n T = []\n def __init_subclass__(cls): cls.T.append(cls)\nclass C(B):\n x = 2\ndef f(): return [c.x for c in B.T]"),
    ("a list changed under another name", "X = []\nY = X\nY.append(1)\ndef f(): return X", "X = []\nY = X\nY.append(2)\ndef f(): return X"),
    ("a list changed through a table", "X = []\nT = {'x': X}\nT['x'].append(1)\ndef f(): return X", "X = []\nT = {'x': X}\nT['x'].append(2)\ndef f(): return X"),
    ("a list filled by a function", "X = []\ndef fill(a):\n a.append(1)\n return a\nY = fill(X)\ndef f(): return X",
     "X = []\ndef fill(a):\n a.append(2)\n return a\nY = fill(X)\ndef f(): return X"),
    ("a list that another module extends", "from pkg.a import X\nimport pkg.b\ndef f(): return X\n--- a.py\nX = []\n--- b.py\nfrom pkg.a import X\nX += [1]",
     "from pkg.a import X\nimport pkg.b\ndef f(): return X\n--- a.py\nX = []\n--- b.py\nfrom pkg.a import X\nX += [2]"),
    ("a method called for what it does", "class R:\n def __init__(self): self.t = []\n def note(self, a): self.t.append(a); return a\nX = R()\nY = X.note(1)\ndef f(): return X",
     "class R:\n def __init__(self): self.t = []\n def note(self, a): self.t.append(a); return a\nX = R()\nY = X.note(2)\ndef f(): return X"),
    ("a function that changes a constant", "X = {}\ndef g(): X['a'] = 1\ndef f(): return X", "X = {}\ndef g(): X['a'] = 2\ndef f(): return X"),
    ("a function that sets an attribute by name", "class C: pass\nX = C()\ndef g(): setattr(X, 'a', 1)\ndef f(): return X", "class C: pass\nX = C()\ndef g(): setattr(X, 'a', 2)\ndef f(): return X"),
    ("a recursion", "def g(n): return n and f(n - 1)\ndef f(n): return g(n)", "def g(n): return n and f(n - 2)\ndef f(n): return g(n)"),
    ("a circle of classes", "class A:\n def g(self): return B()\nclass B(A):\n x = 1\ndef f(): return A()", "class A:\n def g(self): return B()\nclass B(A):\n x = 2\ndef f(): return A()"),
]  # fmt: skip

KEEPS = [
    ("a comment", "def f(a): return a", "# what\ndef f(a): return a  # why"),
    ("a docstring", "def f(a):\n return a", '"""M."""\ndef f(a):\n """F."""\n return a'),
    ("a docstring of a class", "class C: pass\ndef f(): return C", 'class C:\n """C."""\ndef f(): return C'),
    ("a docstring of a constant", "X = 1\ndef f(): return X", 'X = 1\n"""The x."""\ndef f(): return X'),
    ("layout", "def f(a): return (a + 1) * 2", "def f(\n    a,\n):\n\n    return (\n        a + 1\n    ) * 2"),
    ("parentheses", "def f(a): return a + 1", "def f(a): return (((a) + (1)))"),
    ("quotes", "def f(): return 'a'", 'def f(): return """a"""'),
    ("a string in two pieces", "def f(): return 'ab'", "def f(): return 'a' 'b'"),
    ("how a number is written", "def f(): return 1000, 1.5", "def f(): return 1_000, 15e-1"),
    ("a local", "def f(a):\n x = a\n return x", "def f(a):\n y = a\n return y"),
    ("a local used in a closure", "def f(a):\n x = a\n return lambda: x", "def f(a):\n y = a\n return lambda: y"),
    ("a nonlocal", "def f():\n x = 1\n def g():\n  nonlocal x\n  x = 2\n g()\n return x", "def f():\n y = 1\n def g():\n  nonlocal y\n  y = 2\n g()\n return y"),
    ("a name in a comprehension", "def f(a): return [x for x in a if x]", "def f(a): return [y for y in a if y]"),
    ("a name in a constant's comprehension", "X = {i: i for i in range(3)}\ndef f(): return X", "X = {j: j for j in range(3)}\ndef f(): return X"),
    ("the name of an exception", "def f():\n try: pass\n except ValueError as e: print(e)", "def f():\n try: pass\n except ValueError as error: print(error)"),
    ("the name of a context", "def f(a):\n with a as b: return b", "def f(a):\n with a as c: return c"),
    ("the name of a loop", "def f(a):\n for i, *j in a: print(i, j)", "def f(a):\n for k, *l in a: print(k, l)"),
    ("the name of a walrus", "def f(a):\n if (n := len(a)): return n", "def f(a):\n if (m := len(a)): return m"),
    ("the name of a pattern", "def f(a):\n match a:\n  case [x, *y]: return x, y\n  case {'k': v, **w}: return v, w\n  case z: return z",
     "def f(a):\n match a:\n  case [b, *c]: return b, c\n  case {'k': d, **e}: return d, e\n  case g: return g"),
    ("the name of a local import", "def f():\n import numpy as np\n return np.sum", "def f():\n import numpy as xp\n return xp.sum"),
    ("an import's alias", "import numpy as np\ndef f(): return np.sum(1)", "import numpy\ndef f(): return numpy.sum(1)"),
    ("how a function is imported", "from pkg.a import g\ndef f(): return g()\n--- a.py\ndef g(): return 1", "from pkg import a\ndef f(): return a.g()\n--- a.py\ndef g(): return 1"),
    ("an absolute import made relative", "from pkg.a import g\ndef f(): return g()\n--- a.py\ndef g(): return 1", "from .a import g\ndef f(): return g()\n--- a.py\ndef g(): return 1"),
    ("an import moved into the function", "from pkg.a import g\ndef f(): return g()\n--- a.py\ndef g(): return 1", "def f():\n from pkg.a import g\n return g()\n--- a.py\ndef g(): return 1"),
    ("a re-export put between", "from pkg.a import g\ndef f(): return g()\n--- a.py\ndef g(): return 1",
     "from pkg import g\ndef f(): return g()\n--- __init__.py\nfrom .a import g\n--- a.py\ndef g(): return 1"),
    ("an unused import", "def f(): return 1\n--- a.py\nX = 1", "import numpy\nimport pkg.a\nfrom pkg.a import X\ndef f(): return 1\n--- a.py\nX = 1"),
    ("an unused import in the function", "def f(): return 1", "def f():\n import numpy\n return 1"),
    ("the order of imports", "import sys\nimport os\ndef f(): return os, sys", "import os\nimport sys\ndef f(): return os, sys"),
    ("a future import", "def f(): return 1", "from __future__ import annotations\ndef f(): return 1"),
    ("the order of functions", "def g(): return 1\ndef f(): return g()", "def f(): return g()\ndef g(): return 1"),
    ("the order of functions that bind early", "X = 1\ndef g(a=X): return a\ndef h(a=X): return a\ndef f(): return g() + h()",
     "X = 1\ndef h(a=X): return a\ndef g(a=X): return a\ndef f(): return g() + h()"),
    ("a function out of reach", "def f(): return 1\ndef g(): return 1", "def f(): return 1\ndef g(): return 2"),
    ("a function added", "def f(): return 1", "def f(): return 1\ndef g(): return 2"),
    ("a constant out of reach", "X = 1\nY = 1\ndef f(): return X", "X = 1\nY = 2\ndef f(): return X"),
    ("a function that only reads a constant", "X = {}\ndef f(): return X['a']\ndef g(): return X['b'], X.get('a'), len(X)", "X = {}\ndef f(): return X['a']\ndef g(): return 1"),
    ("another constant made from a constant", "X = 1, 2\nY = len(X)\nZ = max(X)\ndef f(): return X", "X = 1, 2\nY = len(X)\nZ = min(X)\ndef f(): return X"),
    ("another object that holds a record", "from dataclasses import dataclass\n@dataclass(frozen=True)\nclass C:\n x: object\nX = C(1)\nY = C((X, 1))\ndef f(): return X",
     "from dataclasses import dataclass\n@dataclass(frozen=True)\nclass C:\n x: object\nX = C(1)\nY = C((X, 2))\ndef f(): return X"),
    ("another table that holds a list", "X = []\nT = {'x': X, 'y': 1}\ndef f(): return X", "X = []\nT = {'x': X, 'y': 2}\ndef f(): return X"),
    ("a caller", "def f(): return 1\ndef g(): return f()", "def f(): return 1\ndef g(): return f() + 1"),
    ("a subclass", "class B: pass\nclass C(B):\n x = 1\ndef f(): return B()", "class B: pass\nclass C(B):\n x = 2\ndef f(): return B()"),
    ("a main block", "def f(): return 1", "def f(): return 1\nif __name__ == '__main__': print(f())"),
    ("the body for checkers", "from typing import TYPE_CHECKING\ndef f(): return 1", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n import numpy\n X = 1\ndef f(): return 1"),
    ("a memo of another function", "M = {}\ndef g(k):\n M[k] = k\n return M[k]\nX = (f0 := 1)\ndef f(): return 1", "M = {}\ndef g(k):\n M[k] = 2 * k\n return M[k]\nX = (f0 := 1)\ndef f(): return 1"),
    ("a module out of reach", "def f(): return 1\n--- a.py\nX = 1", "def f(): return 1\n--- a.py\nX = 2\nprint(X)"),
    ("a pass", "def f(a):\n if a: return 1", "def f(a):\n pass\n if a: return 1"),
]  # fmt: skip


@pytest.mark.parametrize(("before", "after"), [pytest.param(*texts, id=name) for name, *texts in CHANGES])
def test_an_edit_that_matters_changes_the_fingerprint(tmp_path: Path, before: str, after: str) -> None:
    old, new = of(tmp_path, before), of(tmp_path, after)
    assert old.digest != new.digest
    assert changed_parts(old.parts, new.parts)


@pytest.mark.parametrize(("before", "after"), [pytest.param(*texts, id=name) for name, *texts in KEEPS])
def test_an_edit_that_does_not_matter_keeps_the_fingerprint(tmp_path: Path, before: str, after: str) -> None:
    old, new = of(tmp_path, before), of(tmp_path, after)
    assert (old.digest, old.parts) == (new.digest, new.parts)


# each: what is refused, the code, where it is, what the message names
REFUSED = [
    ("getattr on a module", "import pkg.a as m\ndef f(n): return getattr(m, n)()\n--- a.py", "m.py:2", "getattr() on a module"),
    ("getattr on a module, by a constant", "import pkg.a as m\ndef f(): return getattr(m, 'g')\n--- a.py\ndef g(): pass", "m.py:2", "getattr"),
    ("setattr on a module", "import pkg.a as m\ndef f(): setattr(m, 'x', 1)\n--- a.py", "m.py:2", "setattr"),
    ("delattr on a module", "import pkg.a as m\ndef f(): delattr(m, 'x')\n--- a.py", "m.py:2", "delattr"),
    ("hasattr on a module", "import pkg.a as m\ndef f(): return hasattr(m, 'x')\n--- a.py", "m.py:2", "hasattr"),
    ("vars of a module", "import pkg.a as m\ndef f(): return vars(m)\n--- a.py", "m.py:2", "vars"),
    ("a module as an argument", "import pkg.a as m\ndef f(g): return g(m)\n--- a.py", "m.py:2", "handed on"),
    ("a module in a table", "import pkg.a as m\nT = {'m': m}\ndef f(): return T\n--- a.py", "m.py:2", "handed on"),
    ("a module given another name", "import pkg.a as m\ndef f():\n n = m\n return n.g()\n--- a.py", "m.py:3", "handed on"),
    ("a submodule as a value", "import pkg\ndef f(): return pkg.a\n--- a.py", "m.py:2", "handed on"),
    ("one of two modules", "import sys\nif sys.argv: import pkg.a as m\nelse: import pkg.b as m\ndef f(): return m.g()\n--- a.py\n--- b.py", "m.py:2", "stands for a module and for"),
    ("vars()", "def f():\n a = 1\n return vars()", "m.py:3", "vars()"),
    ("dir()", "def f():\n a = 1\n return dir()", "m.py:3", "dir()"),
    ("locals()", "def f(): return locals()", "m.py:1", "locals"),
    ("globals()", "def f(): return globals()", "m.py:1", "globals"),
    ("eval", "def f(a): return eval(a)", "m.py:1", "eval"),
    ("eval under another name", "def f(a):\n g = eval\n return g(a)", "m.py:2", "eval"),
    ("exec", "def f(a): exec(a)", "m.py:1", "exec"),
    ("compile", "def f(a): return compile(a, '', 'exec')", "m.py:1", "compile"),
    ("__import__", "def f(a): return __import__(a)", "m.py:1", "__import__"),
    ("builtins.eval", "import builtins\ndef f(a): return builtins.eval(a)", "m.py:2", "eval"),
    ("import_module", "import importlib\ndef f(a): return importlib.import_module(a)", "m.py:2", "importlib.import_module"),
    ("import_module by name", "from importlib import import_module\ndef f(a): return import_module(a)", "m.py:2", "importlib.import_module"),
    ("import_module on import", "from importlib import import_module\nX = import_module('pkg.a')\ndef f(): return X\n--- a.py", "m.py:2", "importlib.import_module"),
    ("importlib.resources", "from importlib import resources\ndef f(): return resources.read_text('pkg', 'x')", "m.py:2", "importlib.resources"),
    ("sys.modules", "import sys\ndef f(): return sys.modules['pkg.a']", "m.py:2", "sys.modules"),
    ("the module's file", "def f(): return open(__file__).read()", "m.py:1", "__file__"),
    ("another module's file", "import pkg.a\ndef f(): return open(pkg.a.__file__).read()\n--- a.py", "m.py:2", "__file__"),
    ("a function's globals", "def f(): return f.__globals__['g']()", "m.py:1", "__globals__"),
    ("the subclasses of a class", "class B: pass\ndef f(): return B.__subclasses__()", "m.py:2", "__subclasses__"),
    ("a star import", "from pkg.a import *\ndef f(): return g()\n--- a.py\ndef g(): pass", "m.py:1", "star import"),
    ("a star import of a library", "from numpy import *\ndef f(): return sum_of(1)", "m.py:2", "sum_of"),
    ("a global write", "X = 1\ndef f():\n global X\n X = 2", "m.py:2", "X"),
    ("a global write elsewhere", "X = 1\ndef f(): return X\ndef g():\n global X\n X = 2", "m.py:3", "X"),
    ("a global write in a nested function", "X = 1\ndef f(): return X\ndef g():\n def h():\n  global X\n  X += 2\n return h", "m.py:4", "X"),
    ("an unknown name", "def f(): return missing", "m.py:1", "missing"),
    ("an unknown name in a helper", "from pkg.a import g\ndef f(): return g()\n--- a.py\ndef g():\n return missing", "a.py:2", "missing"),
    ("an attribute that a module lacks", "import pkg.a as m\ndef f(): return m.g()\n--- a.py", "m.py:2", "pkg.a:g"),
    ("a name that a module lacks", "from pkg.a import g\ndef f(): return g()\n--- a.py", "m.py:2", "pkg.a:g"),
    ("a module's __getattr__", "import pkg.a as m\ndef f(): return m.g()\n--- a.py\ndef __getattr__(n): return n", "m.py:2", "__getattr__"),
    ("a patched module", "import pkg.a as m\ndef f(): m.x = 1\n--- a.py\nx = 0", "m.py:2", "written from outside"),
    ("a patched module, on import", "import pkg.a as m\nm.x = 1\ndef f(): return m.x\n--- a.py\nx = 0", "m.py:2", "written from outside"),
    ("a patched module, increased", "import pkg.a as m\ndef f(): m.x += 1\n--- a.py\nx = 0", "m.py:2", "written from outside"),
    ("a patch by a function out of reach", "import pkg.a as m\ndef f(): return m.x\ndef g(): m.x = 1\n--- a.py\nx = 0", "m.py:3", "written from outside"),
    ("a missing module", "import pkg.a\ndef f(): return 1", "m.py:1", "pkg.a"),
    ("a missing module, in a function", "def f():\n from pkg.a import g\n return g()", "m.py:2", "pkg.a"),
    ("a compiled module", "from pkg.a import g\ndef f(): return g()\n--- a.abi3.so", "a.abi3.so", "compiled"),
    ("a compiled module beside its source", "from pkg.a import g\ndef f(): return g()\n--- a.abi3.so\n--- a.py\ndef g(): pass", "a.abi3.so", "compiled"),
    ("a syntax error", "from pkg.a import g\ndef f(): return g()\n--- a.py\nx = 1\ndef g(:", "a.py:2", "cannot be read as Python"),
    ("a relative import out of the package", "from ..x import g\ndef f(): return g()", "m.py:1", "climbs out"),
    ("a circle of imports", "from pkg.a import g\ndef f(): return g()\n--- a.py\nfrom pkg.b import g\n--- b.py\nfrom pkg.a import g", "m.py:2", "circle"),
    ("a function and a submodule of one name", "from pkg import a\ndef f(): return a()\n--- __init__.py\ndef a(): pass\n--- a.py", "m.py:2", "two things"),
    ("a problem in an effect", "import pkg.a\ndef f(): return 1\n--- a.py\nx = 1\nexec('x')", "a.py:2", "exec"),
    ("a problem in a default", "def f(a=globals()): return a", "m.py:1", "globals"),
    ("too deep an expression", "def f(): return " + "-" * 400 + "1", "m.py:1", "nested too deeply"),
    ("too deep an expression for Python", "def f(): return " + "-" * 9000 + "1", "m.py", "cannot be read as Python"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "where", "names"), [pytest.param(*rest, id=name) for name, *rest in REFUSED])
def test_what_cannot_be_followed_is_refused(tmp_path: Path, text: str, where: str, names: str) -> None:
    with pytest.raises(UntraceableCodeError) as caught:
        of(tmp_path, text)
    assert where in str(caught.value.where)
    assert names in str(caught.value)


ALLOWED = [
    ("getattr on an object", "def f(a, n): return getattr(a, n)"),
    ("setattr on an object", "class C:\n def __init__(self): object.__setattr__(self, 'x', 1)\ndef f(): return C()"),
    ("vars of an object", "def f(a): return vars(a)['x']"),
    ("getattr on a library", "import cv2\ndef f(n): return getattr(cv2, n)"),
    ("a library as an argument", "import numpy as np\ndef f(g): return g(np)"),
    ("eval of an object", "def f(a): return a.eval('x')"),
    ("a local called eval", "def f(eval): return eval(1)"),
    ("a compiled pattern", "import re\nX = re.compile('a')\ndef f(): return X"),
    ("importlib.metadata", "from importlib.metadata import version\ndef f(): return version('numpy')"),
    ("a global that is only read", "X = 1\ndef f():\n global X\n return X"),
    ("a global written out of reach", "X = 1\ndef f(): return 1\ndef g():\n global X\n X = 2"),
    ("super and __class__", "class C:\n def g(self): return super().__repr__(), __class__\ndef f(): return C()"),
    ("names of the class body", "class C:\n x = __qualname__, __module__\n y = x\ndef f(): return C"),
    ("names of the module", "def f(): return __name__, __debug__"),
    ("a submodule named by importing from it", "def f(): return 1\n--- __init__.py\nfrom pkg.a import g\nX = a.h\nprint(X)\n--- a.py\ndef g(): pass\nh = 1"),
    ("a class attribute in a comprehension's source", "class C:\n x = [1]\n y = [i for i in x]\ndef f(): return C"),
    ("a module that cannot run", "from pkg.a import g\ndef f(): return g()\n--- a.py\n1 / 0\ndef g(): raise RuntimeError"),
    ("a folder without __init__", "from pkg.n.a import g\ndef f(): return g()\n--- n/a.py\ndef g(): pass"),
    ("two modules that import each other", "import pkg.a\ndef f(): return pkg.a.g()\n--- a.py\nimport pkg.m\ndef g(): return pkg.m.f()"),
    ("a quoted annotation that is none", "from typing import Annotated, Literal\ndef f(a: Literal['no name'], b: Annotated[int, 'nor this']) -> 'not ( code': pass"),
    ("a latin-1 file", "# -*- coding: utf-8 -*-\ndef f(): return 'é'"),
    ("a name that Python normalises", "def f():\n ﬁn = 1\n return fin"),
]  # fmt: skip


@pytest.mark.parametrize("text", [pytest.param(text, id=name) for name, text in ALLOWED])
def test_what_can_be_followed_is_not_refused(tmp_path: Path, text: str) -> None:
    assert "pkg.m:f" in of(tmp_path, text).parts
