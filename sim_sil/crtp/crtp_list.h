/// @file crtp_list.h
/// The tables as text, for people and for the page of the documentation.
#ifndef IVL_CRTP_LIST_H
#define IVL_CRTP_LIST_H
#include "crtp_server.h"

/// One line a parameter and a log variable on the standard output, fields between tabulators: kind, name, type, access, and whether it is live or
/// held; parameters also with their value.
void ivl_crtp_list(ivl_crtp_t *crtp);
#endif  // IVL_CRTP_LIST_H
