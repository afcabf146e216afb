/// @file pm.h
/// Declared for the app: the battery.
#ifndef SDK_PM_H
#define SDK_PM_H
float pmGetBatteryVoltage(void);
#endif  // SDK_PM_H
