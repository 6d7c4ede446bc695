"""Logs of other programs, read as ours and written for them.

sources     `import_source`: what a path holds, and each of its runs as a log
bags        ROS 1 and ROS 2 bags; `bag_topics` finds the role of each topic
ros_mcap    an MCAP file with ROS 2 messages that is no part of a bag
json_mcap   MCAP files with JSON messages, read and written
lerobot     LeRobot datasets, read and written
tables      CSV and Parquet files with other columns than ours
foreign     a run of another program, before `column_map` gives its columns our names and units
stamps      samples of several sources, each with stamps of its own, as the columns of one log
"""
