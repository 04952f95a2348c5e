"""Pieces of a loop shared among threads."""

import numba
import pytest
from threadpoolctl import threadpool_info

from idm_sumo.runtime.threads import in_threads, one_blas_thread


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


def test_blas_has_one_thread_while_a_function_runs():
    def threads() -> set[int]:
        return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}

    assert one_blas_thread(threads)() == {1}
