/* random.h - random numbers that are functions of seed, episode and place, so that they do not
 * depend on what was drawn before. */
#ifndef HX_RANDOM_H
#define HX_RANDOM_H

#include <stdint.h>

/* Streams of an episode's random numbers. */
enum { HX_STREAM_COMMAND, HX_STREAM_DRAWS, HX_STREAM_PUSH };

/* Mixes the bits of a number: the finaliser of SplitMix64 (Steele, Lea and Flood, 2014). */
static inline uint64_t hx_mix_bits(uint64_t x) {
  x += UINT64_C(0x9e3779b97f4a7c15);
  x = (x ^ (x >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
  x = (x ^ (x >> 27)) * UINT64_C(0x94d049bb133111eb);
  return x ^ (x >> 31);
}

/* Returns a number uniform in [0, 1), a multiple of 2^-53. */
static inline double hx_uniform(uint64_t seed, uint64_t episode, uint64_t stream, uint64_t place) {
  const uint64_t bits =
      hx_mix_bits(hx_mix_bits(hx_mix_bits(hx_mix_bits(seed) ^ episode) ^ stream) ^ place);
  return (double)(bits >> 11) * 0x1p-53;
}

#endif
