"""The subcommands. Each module has ``add_parser``; heavy imports wait until it runs."""
