#include "hexapod/status.h"

/* FNV-1a over little-endian words, the last one padded with zeros. A shift after each product
 * mixes high bits into low ones, without which changes of sign bits would cancel. Every step is
 * invertible in the hash and in the word. */
uint64_t hx_checksum(uint64_t seed, const void *bytes, size_t n) {
  const unsigned char *byte = bytes;
  uint64_t hash = seed ^ 0xcbf29ce484222325u;
  for (size_t i = 0; i < n; i += 8) {
    uint64_t word = 0;
    for (size_t k = 0; k < 8 && i + k < n; ++k) word |= (uint64_t)byte[i + k] << (8 * k);
    hash = (hash ^ word) * 0x100000001b3u;
    hash ^= hash >> 32;
  }
  return (hash ^ n) * 0x100000001b3u;
}
