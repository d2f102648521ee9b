"""KRL as text: lexer, parser, the program as data, and its rendering."""
