/// @file layout.c
/// Compiled for this computer, for its debug information: how the messages of ivl_port.h lie in memory here.
#include "ivl_port.h"

extern ivl_port_hello_t   hello;
extern ivl_port_request_t request;
extern ivl_port_reply_t   reply;

ivl_port_hello_t   hello;
ivl_port_request_t request;
ivl_port_reply_t   reply;
