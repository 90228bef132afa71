"""Stage 7, see: the one list of all that is drawn of a mechanism, its forms and its colours."""
