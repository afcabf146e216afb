/// @file unity_output.h
/// Included by Unity's configuration when the unit tests are built for the chip.
#ifndef UNITY_OUTPUT_H
#define UNITY_OUTPUT_H
void unity_output_char(int c);
#endif  // UNITY_OUTPUT_H
