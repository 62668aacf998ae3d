#pragma once

#include "wire/codec/cdr.hpp"

#include <cstdint>
#include <vector>

namespace subworld::live {

/// A message that `write(archive)` writes, with its header.
std::vector<std::uint8_t> written(auto write) {
  const Changes none;
  std::vector<std::uint8_t> bytes;
  CdrWriter archive(bytes, none);
  write(archive);
  bytes.resize(archive.written().size());
  return bytes;
}

}  // namespace subworld::live
