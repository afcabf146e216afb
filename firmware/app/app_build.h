/// @file app_build.h
/// Number of this build: a checksum of the sources of core and app, which firmware/Makefile makes.  0: made by something else.
#ifndef APP_BUILD_H
#define APP_BUILD_H
#ifndef IVL_BUILD
#define IVL_BUILD 0x00000000
#endif

#define APP_TEXT_OF(number) #number
#define APP_TEXT(macro)     APP_TEXT_OF(macro)
#endif  // APP_BUILD_H
