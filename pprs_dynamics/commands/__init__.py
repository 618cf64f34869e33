"""The command-line tool `pprs`: arguments -> one call -> report. One file per subcommand."""
