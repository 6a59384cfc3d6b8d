"""The program takes scipy's functions without their package, which loads itself when anything else is asked of it."""

from __future__ import annotations

import subprocess
import sys

BEGIN = """
import sys
from tumble.cli.scipy_functions import FunctionsAlone
sys.meta_path.insert(0, FunctionsAlone())
"""


def run(code: str) -> str:
    made = subprocess.run([sys.executable, "-c", BEGIN + code], capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    return made.stdout.strip()


def test_functions_are_scipys_own_and_nothing_else_is_loaded() -> None:
    """Of three degrees of freedom, chi-square 7.8147 is the 5 % point of every table."""
    said = run(
        "from scipy.special import chdtrc\n"
        "print(round(float(chdtrc(3.0, 7.814728)), 8),"
        " [n for n in ('scipy.special._basic', 'numpy.f2py') if n in sys.modules])"
    )
    assert said == "0.05 []"


def test_what_is_no_such_function_loads_the_package_as_it_is() -> None:
    said = run(
        "import scipy.special as special\n"
        "before = special.chdtrc\n"
        "from scipy.special import comb\n"
        "import scipy.stats\n"
        "print(int(comb(5, 2)), special.chdtrc is before, hasattr(special, 'nothing'))\n"
        "print(round(float(scipy.stats.chi2.ppf(0.95, 3)), 4), 'logsumexp' in special.__all__)"
    )
    assert said.splitlines() == ["10 True False", "7.8147 True"]


def test_threads_that_ask_at_once_get_the_whole_package() -> None:
    said = run(
        "from concurrent.futures import ThreadPoolExecutor\n"
        "import scipy.special\n"
        "with ThreadPoolExecutor(8) as pool:\n"
        "    found = list(pool.map(lambda _: scipy.special.comb(5, 2) + scipy.special.logsumexp([0.0]), range(64)))\n"
        "print(set(map(float, found)))"
    )
    assert said == "{10.0}"


def test_a_scipy_that_has_its_functions_elsewhere_is_loaded_whole() -> None:
    said = run(
        "import tumble.cli.scipy_functions as ours\n"
        "ours.FUNCTIONS = 'scipy.special._elsewhere'\n"
        "from scipy.special import chdtrc\n"
        "print(round(float(chdtrc(3.0, 7.814728)), 8))"
    )
    assert said == "0.05"
