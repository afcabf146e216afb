/// @file app_cpx.c
/// Readings of a camera from a deck that speaks CPX, such as the AI-deck: the app channel's packet as a message for the function APP.
/// Part of the drone's build alone, where the SDK has CPX.  The handler runs in the task of CPX.
///
/// The deck's WiFi carries messages of strangers, too.  They name a computer on the network as their source, and are refused.  That is no proof:
/// the deck does not check what its clients write there (docs/SECURITY.md).
#include "app_ivl.h"
#include "cpx.h"
#include "usec_time.h"

static bool is_from_camera(const CPXPacket_t *message)
{
    return message->route.source == CPX_T_GAP8;
}

static void on_message(const CPXPacket_t *message)
{
    ivl_wire_reading_t packet;
    if (is_from_camera(message) && ivl_wire_get_reading(message->data, message->dataLength, &packet))
    {
        app_reading_put(&ivl_app, APP_CAMERA_CPX, &packet, usecTimestamp());
    }
    else
    {
        atomic_fetch_add(&ivl_app.n_reading_bad, 1u);
    }
}

void app_cpx_start(void)
{
    cpxRegisterAppMessageHandler(on_message);
}
