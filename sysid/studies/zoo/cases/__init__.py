"""The cases of the zoo: what is hidden, how large, in which commands and which logs."""
