#ifndef MECANUM_ROLLER_CONTACT_H
#define MECANUM_ROLLER_CONTACT_H

// Have MuJoCo touch the floor with barrels where it is told to; the library's start calls it (mecanum_wheel.c).
void roller_contact_register(void);

#endif
