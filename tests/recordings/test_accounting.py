import numpy as np
import pandas as pd
import pytest

from idm_sumo.recordings.accounting import Accounting, Ledger


def test_ledger_books_every_row_it_drops() -> None:
    ledger = Ledger(5)
    table = pd.DataFrame({"a": range(5)})
    table = ledger.drop(table, table["a"] > 3, "too big")
    table = ledger.drop(table, np.array([True, False, False, True]), "odd")
    account = ledger.close(len(table), vehicles=1)
    assert account.dropped == {"too big": 1, "odd": 2}
    assert account.used == 2


def test_a_lost_row_is_a_defect() -> None:
    with pytest.raises(AssertionError, match="10 rows read, 7 used"):
        Accounting(10, 7, {"duplicate": 2}).check()


def test_stages_add_up() -> None:
    both = Accounting(10, 8, {"duplicate": 2}, 4).then(Accounting(8, 5, {"duplicate": 1, "ramp": 2}, 3, {"ramp": 1}))
    assert (both.total, both.used, both.dropped) == (10, 5, {"duplicate": 3, "ramp": 2})
    assert (both.vehicles, both.vehicles_dropped) == (3, {"ramp": 1})


def test_stages_that_do_not_meet_are_a_defect() -> None:
    with pytest.raises(AssertionError, match="8 rows left one stage, 9 entered"):
        Accounting(10, 8, {"duplicate": 2}).then(Accounting(9, 9))
