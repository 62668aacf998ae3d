#pragma once

#include "io/records/mcap_writer.hpp"

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace subworld::mcap {

struct Message {
  std::uint16_t channel = 0;
  std::uint32_t number = 0;  ///< of its writer
  std::uint64_t time_ns = 0;
  std::span<const std::uint8_t> data;
};

/// The messages of a chunk, in the order of time.
struct Chunk {
  std::vector<std::uint8_t> bytes;  ///< in which the messages lie
  std::vector<Message> messages;
};

struct Schema {
  std::string name, encoding, text;
};

/// Reads files as `Writer` makes them, through their summary; those without an end up to their last whole record.
class Reader {
 public:
  /// Throws `Error` (usage) where the file cannot be read or is damaged, as all functions here do.
  explicit Reader(const std::string& path);

  /// Why the file has no end, and what is missing; empty: it is whole.
  [[nodiscard]] const std::string& lacks() const noexcept { return lacks_; }

  /// Names and contents of the attachments, whose checksums are checked.
  [[nodiscard]] std::map<std::string, std::string> attachments();
  /// Topics by channel.
  [[nodiscard]] const std::map<std::uint16_t, std::string>& topics() const noexcept { return topics_; }
  /// Of the messages of a channel in `topics()`.
  [[nodiscard]] const Schema& schema_of(std::uint16_t channel) const { return schemas_.at(schema_ids_.at(channel)); }
  [[nodiscard]] std::size_t chunks() const noexcept { return chunks_.size(); }
  /// The first chunk that has messages at or after a time; `chunks()` if none has.
  [[nodiscard]] std::size_t chunk_at(std::uint64_t time_ns) const noexcept;
  /// The last chunk whose time is at most `time_s`; 0 if none is. `time_of` gives the simulated time with which a chunk
  /// begins, or nothing; it rises from chunk to chunk.
  [[nodiscard]] std::size_t last_chunk_before(double time_s,
                                              const std::function<std::optional<double>(const Chunk&)>& time_of);
  /// Reads a chunk, and checks its checksum.
  [[nodiscard]] Chunk read_chunk(std::size_t number);
  [[nodiscard]] std::uint64_t from_ns() const noexcept { return from_ns_; }
  [[nodiscard]] std::uint64_t to_ns() const noexcept { return to_ns_; }
  [[nodiscard]] std::uint64_t messages() const noexcept { return messages_; }
  [[nodiscard]] double duration_s() const noexcept { return 1e-9 * static_cast<double>(to_ns_ - from_ns_); }

 private:
  struct Place {
    std::uint64_t start = 0, length = 0;
  };
  void read_summary();
  void scan();
  /// A schema or a channel.
  void keep(Op op, std::span<const std::uint8_t> content);
  std::vector<std::uint8_t> read(std::uint64_t start, std::uint64_t length);
  [[noreturn]] void fail(const std::string& why) const;

  std::string path_;
  std::ifstream file_;
  std::uint64_t size_ = 0;
  struct ChunkPlace : Place {
    std::uint64_t to_ns = 0;
  };
  std::vector<Place> attachments_;
  std::vector<ChunkPlace> chunks_;
  std::map<std::uint16_t, std::string> topics_;
  std::map<std::uint16_t, Schema> schemas_;
  std::map<std::uint16_t, std::uint16_t> schema_ids_;  // by channel
  std::uint64_t messages_ = 0, from_ns_ = 0, to_ns_ = 0;
  std::string lacks_;
};

}  // namespace subworld::mcap
