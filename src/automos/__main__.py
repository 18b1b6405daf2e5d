"""`automos`, and `python -m automos`: the command line."""

import signal


def main() -> None:
    """Run the command line; while its parts are imported, Ctrl-C ends it without a word."""
    handler = signal.getsignal(signal.SIGINT)
    if handler is signal.default_int_handler:  # else whoever started us has Ctrl-C go past us
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from automos.cli import main as run_command

    signal.signal(signal.SIGINT, handler)
    run_command()


if __name__ == "__main__":
    main()
