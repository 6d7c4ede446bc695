"""The console command `mecanum`: every program under one name. Imports programs only when they run."""
