#include "model/error.hpp"
#include "physics/adapter.hpp"
#include "physics/wasm/host.hpp"

#include <sys/mman.h>
#include <algorithm>

namespace subworld::wasm {

namespace {

constexpr std::size_t kBlock = 4096;
constexpr std::uint64_t kPage = 65536;  ///< of wasm

bool all_zero(const std::uint8_t* block) {
  // A block that equals itself shifted by one byte has a single value.
  return block[0] == 0 && std::memcmp(block, block + 1, kBlock - 1) == 0;
}

}  // namespace

void save(const wasm_rt_memory_t& memory, std::vector<std::byte>& out) {
  append(&memory.pages, sizeof memory.pages, out);
  for (std::uint64_t at = 0; at < memory.size; at += kBlock) {
    if (all_zero(memory.data + at)) continue;
    append(&at, sizeof at, out);
    append(memory.data + at, kBlock, out);
  }
}

void restore(wasm_rt_memory_t& memory, std::span<const std::byte> saved) {
  constexpr std::size_t kEntry = sizeof(std::uint64_t) + kBlock;
  std::uint64_t pages = 0;
  if (saved.size() >= sizeof pages) std::memcpy(&pages, saved.data(), sizeof pages);
  if (pages == 0 || pages > memory.max_pages || (saved.size() - sizeof pages) % kEntry != 0) {
    throw Error(ExitCode::failed, "the checkpoint is of another engine; take one from this engine");
  }
  const std::span<const std::byte> blocks = saved.subspan(sizeof pages);
  const auto place_of = [&](std::size_t entry) {
    std::uint64_t at = 0;
    std::memcpy(&at, blocks.data() + entry, sizeof at);
    return at;
  };
  for (std::size_t entry = 0; entry < blocks.size(); entry += kEntry) {
    if (place_of(entry) > pages * kPage - kBlock) {
      throw Error(ExitCode::failed, "the checkpoint is damaged; take another one");
    }
  }
  if (pages > memory.pages && wasm_rt_grow_memory(&memory, pages - memory.pages) == UINT32_MAX) {
    throw Error(ExitCode::failed, "no memory for the checkpoint; end other programs");
  }
  // Zero, and returned to the system; locked memory does not support that advice.
  if (madvise(memory.data, memory.size, MADV_DONTNEED) != 0) std::memset(memory.data, 0, memory.size);
  memory.pages = pages;
  memory.size = pages * kPage;
  for (std::size_t entry = 0; entry < blocks.size(); entry += kEntry) {
    std::memcpy(memory.data + place_of(entry), blocks.data() + entry + sizeof(std::uint64_t), kBlock);
  }
}

}  // namespace subworld::wasm
