/// @file crtp.h
/// Declared for the app: the state of the link; over radio it is up until 1 s after the last packet.
#ifndef SDK_CRTP_H
#define SDK_CRTP_H
#include <stdbool.h>

bool crtpIsConnected(void);
#endif  // SDK_CRTP_H
