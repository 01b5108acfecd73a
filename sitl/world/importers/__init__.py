"""Buildings in other people's formats. An importer mends or refuses, and says what it did."""
