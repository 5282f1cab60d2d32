"""The `pendsus` command as ``python -m suspension_cli``."""

from suspension_cli.cli.main import main

if __name__ == "__main__":
    main(prog_name="pendsus")
