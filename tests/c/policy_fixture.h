/// @file policy_fixture.h
/// Policies of the constant form, for tests that need one, as a struct and as the packet that brings it.
#ifndef POLICY_FIXTURE_H
#define POLICY_FIXTURE_H
#include "ivl_parts.h"

static inline ivl_policy_t constant_policy(uint32_t seq, float rrev_c_per_s, float moment_Nm)
{
    ivl_policy_t policy = {.id = {.seq = seq}, .n = 2, .theta = {rrev_c_per_s, moment_Nm}};
    policy.id.crc = ivl_policy_crc(&policy);
    return policy;
}

/// Number `part` of the packets that bring a policy.
static inline ivl_wire_policy_t packet_of(const ivl_policy_t *policy, uint8_t part)
{
    const float *theta = &policy->theta[IVL_WIRE_THETAS * part];
    return (ivl_wire_policy_t){.seq = policy->id.seq,
                               .crc = policy->id.crc,
                               .form = policy->id.form,
                               .n = policy->n,
                               .part = part,
                               .theta0 = theta[0],
                               .theta1 = theta[1],
                               .theta2 = theta[2],
                               .theta3 = theta[3]};
}

static inline ivl_wire_policy_t constant_packet(uint32_t seq, float rrev_c_per_s, float moment_Nm)
{
    const ivl_policy_t policy = constant_policy(seq, rrev_c_per_s, moment_Nm);
    return packet_of(&policy, 0);
}
#endif  // POLICY_FIXTURE_H
