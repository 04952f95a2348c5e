"""Pieces of a loop shared among threads."""

import numba
import pytest

from idm_sumo.runtime.threads import in_threads


@pytest.mark.parametrize("count", [0, 1, 3, 17, 1000])
def test_the_pieces_cover_everything_once(count):
    done = []
    in_threads(lambda first, last, offset: done.extend(range(first + offset, last + offset)), count, 5)
    assert sorted(done) == list(range(5, count + 5))


def test_what_goes_wrong_in_a_thread_is_raised():
    def fail(first, last):
        raise ValueError(f"{first} to {last}")

    threads = numba.get_num_threads()
    with pytest.raises(ValueError, match="0 to"):
        in_threads(fail, 10 * threads)
