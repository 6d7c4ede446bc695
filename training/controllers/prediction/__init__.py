"""What controllers expect: where the robot will be, and when, where and how near to it a strike will land."""
