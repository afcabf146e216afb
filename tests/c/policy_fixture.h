/// @file policy_fixture.h
/// Policies for tests that need one, as a struct and as the packet that brings it.
#ifndef POLICY_FIXTURE_H
#define POLICY_FIXTURE_H
#include "ivl_parts.h"

static inline ivl_policy_t constant_policy(uint32_t seq, float rrev_c_per_s, float moment_Nm)
{
    ivl_policy_t policy = {.id = {.seq = seq}, .n = 2, .theta = {rrev_c_per_s, moment_Nm}};
    policy.id.crc = ivl_policy_crc(&policy);
    return policy;
}

/// A policy for every approach that would flip at RREV = 4.8 /s in the middle of them, but expects no landing anywhere.
static inline ivl_policy_t no_go_policy(uint32_t seq)
{
    ivl_policy_t policy = {.id = {.seq = seq}, .n = ivl_form_polynomial2.n_params};
    while (ivl_form(policy.id.form) != &ivl_form_polynomial2)
    {
        policy.id.form++;
    }
    policy.theta[0] = 4.8f;
    policy.theta[6] = 0.008f;
    policy.theta[9] = 0.5f;    // go_p_min
    policy.theta[10] = -3.0f;  // log-odds of a landing
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
