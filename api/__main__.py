"""`python -m kinemimic`: the command line."""

from kinemimic.pipeline.cli.main import main

if __name__ == "__main__":
    main()
