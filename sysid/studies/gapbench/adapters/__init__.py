"""Methods that name what a simulator lacks, as people use them today, and this project's own."""
