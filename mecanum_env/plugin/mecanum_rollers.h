#ifndef MECANUM_MECANUM_ROLLERS_H
#define MECANUM_MECANUM_ROLLERS_H

// Make the plugin "mecanum.rollers" known to MuJoCo; the library's start calls it (mecanum_wheel.c).
void mecanum_rollers_register(void);

#endif
