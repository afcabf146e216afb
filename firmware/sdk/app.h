/// @file app.h
/// Declared for the app: entry of its task, which must not return.
#ifndef SDK_APP_H
#define SDK_APP_H
void appMain(void);
#endif  // SDK_APP_H
