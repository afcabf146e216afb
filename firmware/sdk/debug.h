/// @file debug.h
/// Declared for the app: text for the host's console.
#ifndef SDK_DEBUG_H
#define SDK_DEBUG_H
#ifdef SDK_ON_HOST
void sdk_print(const char *format, ...) __attribute__((format(printf, 1, 2)));
#define DEBUG_PRINT(format, ...) sdk_print(DEBUG_MODULE ": " format, ##__VA_ARGS__)
#else
int consolePrintf(const char *format, ...) __attribute__((format(printf, 1, 2)));
#define DEBUG_PRINT(format, ...) consolePrintf(DEBUG_MODULE ": " format, ##__VA_ARGS__)
#endif
#endif  // SDK_DEBUG_H
