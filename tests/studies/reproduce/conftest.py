import pytest

from mecanum_env.parallel import Workers
from sysid.studies.reproduce.contenders import QUICK
from sysid.studies.reproduce.data import record_data_sets
from sysid.studies.reproduce.experiment import reproduce


@pytest.fixture(scope="session")
def quick_stages():
    return []


@pytest.fixture(scope="session")
def quick(quick_stages):
    """The whole experiment with few starts; about six seconds."""
    return reproduce(0, QUICK, quick_stages.append, Workers(jobs=1))


@pytest.fixture(scope="session")
def data():
    return record_data_sets(0)
