"""The command ``garment``; imports nothing until signals are handled."""

from __future__ import annotations

from garment_dataset import interrupts


def main() -> None:
    """Run the command."""
    interrupts.install()
    from garment_dataset import cli

    cli.main()


if __name__ == "__main__":
    main()
