/// @file range.h
/// Declared for the app: the ranging sensors of the decks.
#ifndef SDK_RANGE_H
#define SDK_RANGE_H
typedef enum
{
    rangeFront = 0,
    rangeBack,
    rangeLeft,
    rangeRight,
    rangeUp,
    rangeDown
} rangeDirection_t;

/// mm, whole; 0 without such a sensor.  Whatever the SDK's own comment says about metres: its code returns what the log variable shows.
float rangeGet(rangeDirection_t direction);
#endif  // SDK_RANGE_H
