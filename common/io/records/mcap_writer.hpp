#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace subworld::mcap {

/// Appends the basic types of the format: little-endian integers, and texts, maps and bytes after their length.
class Bytes {
 public:
  template <class T>
  void number(T value) {
    for (std::size_t i = 0; i < sizeof(T); ++i) all_.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
  }
  void raw(std::span<const std::uint8_t> bytes) { all_.insert(all_.end(), bytes.begin(), bytes.end()); }
  void text(std::string_view text) {
    number(static_cast<std::uint32_t>(text.size()));
    all_.insert(all_.end(), text.begin(), text.end());
  }
  [[nodiscard]] const std::vector<std::uint8_t>& all() const noexcept { return all_; }
  [[nodiscard]] std::size_t size() const noexcept { return all_.size(); }
  void clear() noexcept { all_.clear(); }

 private:
  std::vector<std::uint8_t> all_;
};

/// The first byte of each record.
enum class Op : std::uint8_t {
  header = 1,
  footer,
  schema,
  channel,
  message,
  chunk,
  message_index,
  chunk_index,
  attachment,
  attachment_index,
  statistics,
  summary_offset = 0x0e,
  data_end
};

inline constexpr std::array<std::uint8_t, 8> kMagic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

/// Writes a file in the format MCAP (mcap.dev, version 0): chunks without compression, an index of messages after each,
/// and a summary. All checksums are CRC-32. One thread.
class Writer {
 public:
  /// A file that holds something keeps it until the first messages are written. Throws `Error` (failed), as all
  /// functions here do, where the file cannot be written.
  explicit Writer(const std::string& path);
  /// Closes a file that has no summary where finish() was not called.
  ~Writer();
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  [[nodiscard]] std::uint16_t add_schema(const std::string& name, const std::string& encoding, std::string_view text);
  [[nodiscard]] std::uint16_t add_channel(std::uint16_t schema, const std::string& topic, const std::string& encoding);
  void write(std::uint16_t channel, std::uint32_t number, std::uint64_t time_ns, std::span<const std::uint8_t> data);
  /// Ends the chunk, so that a reader of the unfinished file has all messages.
  void flush();
  void attach(const std::string& name, const std::string& media_type, std::string_view data, std::uint64_t time_ns);
  /// Writes the summary and closes the file. Without messages an earlier content stays.
  void finish();
  [[nodiscard]] bool keeps_earlier() const noexcept { return keeps_earlier_; }

  /// Messages that are not in the file yet.
  [[nodiscard]] std::uint64_t unwritten() const noexcept;
  [[nodiscard]] std::uint64_t bytes() const noexcept { return written_ + chunk_.size(); }

 private:
  void put(std::span<const std::uint8_t> bytes);
  void write_out(std::span<const std::uint8_t> bytes);
  void put_record(Op op, const Bytes& content);
  std::pair<std::uint64_t, std::uint64_t> put_group(const std::vector<Bytes>& records, Op op);

  std::string path_;
  int file_ = -1;
  bool keeps_earlier_ = false;
  Bytes held_;  // to be written in the place of the earlier content
  std::uint64_t written_ = 0;
  std::uint32_t crc_ = 0;  // of all that was written, later of the summary
  std::vector<Bytes> schemas_, channels_, chunk_indexes_, attachment_indexes_;
  Bytes chunk_;
  std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> chunk_messages_;  // time, offset
  std::uint64_t chunk_from_ns_ = 0, chunk_to_ns_ = 0, from_ns_ = 0, to_ns_ = 0;
  std::map<std::uint16_t, std::uint64_t> counts_;
};

}  // namespace subworld::mcap
