"""Other people's recordings into the standard drive table: one reader per format.

Every reader returns an `Imported`: the table, and a record of where it came from, what was cut out and how sure the
lane centres are. `write_imported` puts both into one Parquet or CSV file.
"""
