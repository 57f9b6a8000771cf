#include "persist/fingerprint_tables.h"

#include "pvid/fnv_word.h"

uint32_t pvid_fingerprint_bytes(uint32_t hash, const uint8_t values[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, values[i]);
    }
    return running;
}

uint32_t pvid_fingerprint_signals(uint32_t hash, const pvid_weak_signal signal[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        const uint8_t fields[] = {signal[i].sample, signal[i].source};
        running = pvid_fingerprint_bytes(running, fields, sizeof fields);
    }
    return running;
}

uint32_t pvid_fingerprint_jets(uint32_t hash, const pvid_weak_jet jet[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        const uint8_t fields[] = {jet[i].signal, jet[i].order};
        running = pvid_fingerprint_bytes(running, fields, sizeof fields);
    }
    return running;
}

uint32_t pvid_fingerprint_channels(uint32_t hash, const pvid_weak_channel channel[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        const pvid_weak_channel *one = &channel[i];
        const uint8_t fields[] = {one->gain, one->integrand, one->fold, one->plain, one->ramp};
        running = pvid_fingerprint_bytes(running, fields, sizeof fields);
    }
    return running;
}

uint32_t pvid_fingerprint_kinds(uint32_t hash, const pvid_weak_kind kind[], size_t n)
{
    uint32_t running = hash;
    for (size_t i = 0; i < n; i++) {
        running = pvid_fnv_word(running, kind[i].thetas);
        running = pvid_fnv_word(running, kind[i].nuisances);
        running = pvid_fnv_word(running, kind[i].first);
        running = pvid_fnv_word(running, kind[i].end);
    }
    return running;
}
