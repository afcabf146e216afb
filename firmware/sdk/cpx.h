/// @file cpx.h
/// Declared for the app: messages from other processors, such as those of the AI-deck.
#ifndef SDK_CPX_H
#define SDK_CPX_H
#include <stdbool.h>
#include <stdint.h>

#define CPX_MAX_PAYLOAD_SIZE 100

typedef enum
{
    CPX_T_STM32 = 1,
    CPX_T_ESP32 = 2,
    CPX_T_WIFI_HOST = 3,
    CPX_T_GAP8 = 4
} CPXTarget_t;

typedef enum
{
    CPX_F_APP = 5
} CPXFunction_t;

typedef struct
{
    CPXTarget_t   destination;
    CPXTarget_t   source;
    bool          lastPacket;
    CPXFunction_t function;
    uint8_t       version;
} CPXRouting_t;

typedef struct
{
    CPXRouting_t route;
    uint16_t     dataLength;
    uint8_t      data[CPX_MAX_PAYLOAD_SIZE];
} CPXPacket_t;

typedef void (*cpxAppMessageHandlerCallback_t)(const CPXPacket_t *cpxRx);

/// Called for each message to the function APP, in the task of CPX; replaces the handler of before.
void cpxRegisterAppMessageHandler(cpxAppMessageHandlerCallback_t callback);
#endif  // SDK_CPX_H
