"""BLAS in one thread while somebody asks for it, and as before afterwards."""

from threadpoolctl import ThreadpoolController, threadpool_limits

from automos.core.blas import one_blas_thread


def n_threads() -> set[int]:
    return {library["num_threads"] for library in ThreadpoolController().select(user_api="blas").info()}


def test_the_last_to_leave_gives_the_threads_back():
    with threadpool_limits(2, "blas"):
        before = n_threads()
        first, second = one_blas_thread(), one_blas_thread()
        first.__enter__()
        second.__enter__()
        assert n_threads() == {1}
        first.__exit__(None, None, None)
        assert n_threads() == {1}
        second.__exit__(None, None, None)
        assert n_threads() == before


def test_an_error_gives_them_back():
    with threadpool_limits(2, "blas"):
        before = n_threads()
        try:
            with one_blas_thread():
                raise ValueError
        except ValueError:
            pass
        assert n_threads() == before
