#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

/// An input of the codec's fuzzing: the row of a topic in `kTopicTable`, then the messages of one writer, each with its
/// length in two bytes (little-endian) before it. Several, because a message can refer to an earlier one.
namespace subworld::fuzz {

inline constexpr std::size_t kLength_bytes = 2;

inline void append_message(std::vector<std::uint8_t>& input, std::span<const std::uint8_t> message) {
  input.push_back(static_cast<std::uint8_t>(message.size()));
  input.push_back(static_cast<std::uint8_t>(message.size() >> 8U));
  input.insert(input.end(), message.begin(), message.end());
}

/// Takes the next message off the input; a length that is too long ends with it. Nothing: the input is over.
inline std::optional<std::span<const std::uint8_t>> next_message(std::span<const std::uint8_t>& input) {
  if (input.size() < kLength_bytes) return std::nullopt;
  const std::size_t length = input[0] | static_cast<std::size_t>(input[1]) << 8U;
  input = input.subspan(kLength_bytes);
  const std::span<const std::uint8_t> message = input.first(std::min(length, input.size()));
  input = input.subspan(message.size());
  return message;
}

}  // namespace subworld::fuzz
