/// @file app_channel.h
/// Declared for the app: packets of up to 30 bytes between an app and the host.
#ifndef SDK_APP_CHANNEL_H
#define SDK_APP_CHANNEL_H
#include <stdbool.h>
#include <stddef.h>

#define APPCHANNEL_MTU (30)

/// Post a packet without blocking.  @return 1 if it was posted
int appchannelSendDataPacket(void *data, size_t length);

/// Wait for a packet.  @return its size, 0 after timeout_ms without one
size_t appchannelReceiveDataPacket(void *buffer, size_t max_length, int timeout_ms);
#endif  // SDK_APP_CHANNEL_H
