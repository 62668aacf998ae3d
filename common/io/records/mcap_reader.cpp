#include "io/records/mcap_reader.hpp"

#include "model/error.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>

namespace subworld::mcap {

namespace {

constexpr std::uint64_t kRecordHead = 9, kFooter = 20, kEnd = kRecordHead + kFooter + kMagic.size();

/// The numbers and texts of a record, in their order. Past its end all are zero or empty.
class Cursor {
 public:
  explicit Cursor(std::span<const std::uint8_t> bytes) : rest_(bytes) {}
  template <class T>
  T number() {
    T value = 0;
    const std::span<const std::uint8_t> bytes = raw(sizeof(T));
    for (std::size_t i = 0; i < bytes.size(); ++i) value |= static_cast<T>(static_cast<T>(bytes[i]) << (8 * i));
    return value;
  }
  std::span<const std::uint8_t> raw(std::uint64_t count) {
    const auto some = static_cast<std::size_t>(std::min<std::uint64_t>(count, rest_.size()));
    const std::span<const std::uint8_t> bytes = rest_.first(some);
    rest_ = rest_.subspan(some);
    return bytes;
  }
  std::string text() { return text_of(raw(number<std::uint32_t>())); }
  static std::string text_of(std::span<const std::uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }
  [[nodiscard]] bool empty() const noexcept { return rest_.empty(); }

 private:
  std::span<const std::uint8_t> rest_;
};

std::uint32_t crc_of(std::span<const std::uint8_t> bytes) {
  return static_cast<std::uint32_t>(crc32_z(0, bytes.data(), bytes.size()));
}

/// Whether a `Writer` has the file open.
bool is_being_written(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const bool locked = file >= 0 && flock(file, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  if (file >= 0) close(file);
  return locked;
}

}  // namespace

void Reader::fail(const std::string& why) const {
  throw Error(ExitCode::usage, fmt::format("{}: {}; name a file of `subworld run --record`", path_, why));
}

std::vector<std::uint8_t> Reader::read(std::uint64_t start, std::uint64_t length) {
  if (start > size_ || length > size_ - start) fail("a record lies outside the file");
  std::vector<std::uint8_t> bytes(length);
  file_.seekg(static_cast<std::streamoff>(start));
  file_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(length));
  if (!file_) fail("cannot be read");
  return bytes;
}

Reader::Reader(const std::string& path) : path_(path), file_(path, std::ios::binary | std::ios::ate) {
  if (!file_) fail("cannot be opened");
  size_ = static_cast<std::uint64_t>(file_.tellg());
  if (size_ < kMagic.size() || !std::ranges::equal(read(0, kMagic.size()), kMagic))
    fail("is no recording in the format MCAP");
  if (size_ >= kMagic.size() + kEnd && std::ranges::equal(read(size_ - kMagic.size(), kMagic.size()), kMagic)) {
    read_summary();
  } else {
    scan();
  }
}

void Reader::keep(Op op, std::span<const std::uint8_t> content) {
  Cursor record(content);
  const auto id = record.number<std::uint16_t>();
  if (op == Op::schema) {
    Schema& schema = schemas_[id];
    for (std::string* part : {&schema.name, &schema.encoding, &schema.text}) *part = record.text();
  } else if (op == Op::channel) {
    schema_ids_[id] = record.number<std::uint16_t>();
    topics_[id] = record.text();
  }
}

void Reader::read_summary() {
  const auto end = read(size_ - kEnd, kEnd);
  Cursor footer{std::span<const std::uint8_t>(end).subspan(kRecordHead)};
  const auto summary = footer.number<std::uint64_t>();
  (void)footer.number<std::uint64_t>();
  const auto crc = footer.number<std::uint32_t>();
  if (summary == 0 || summary > size_ - kEnd) fail("has no summary");
  const auto bytes = read(summary, size_ - kMagic.size() - sizeof(crc) - summary);
  if (crc_of(bytes) != crc) fail("the checksum of its summary is wrong");
  for (Cursor records(bytes); !records.empty();) {
    const auto op = static_cast<Op>(records.number<std::uint8_t>());
    const auto content = records.raw(records.number<std::uint64_t>());
    Cursor record(content);
    keep(op, content);
    if (op == Op::attachment_index) {
      Place& place = attachments_.emplace_back();
      place.start = record.number<std::uint64_t>();
      place.length = record.number<std::uint64_t>();
    } else if (op == Op::chunk_index) {
      (void)record.number<std::uint64_t>();
      ChunkPlace& place = chunks_.emplace_back();
      place.to_ns = record.number<std::uint64_t>();
      place.start = record.number<std::uint64_t>();
      place.length = record.number<std::uint64_t>();
    } else if (op == Op::statistics) {
      messages_ = record.number<std::uint64_t>();
      (void)record.raw(2 + 4 + 4 + 4 + 4);
      from_ns_ = record.number<std::uint64_t>();
      to_ns_ = record.number<std::uint64_t>();
    }
  }
}

void Reader::scan() {
  lacks_ = is_being_written(path_)
               ? "its run is still being recorded: the newest second and the summary are missing"
               : "it has no end, because its recorder was killed: the last second and the summary are missing";
  for (std::uint64_t at = kMagic.size(); size_ - at >= kRecordHead;) {
    const auto head = read(at, kRecordHead);
    Cursor cursor(head);
    const auto op = static_cast<Op>(cursor.number<std::uint8_t>());
    const auto length = cursor.number<std::uint64_t>();
    if (length > size_ - at - kRecordHead || op == Op::data_end) return;
    const Place place{at, kRecordHead + length};
    at += place.length;
    if (op == Op::attachment) attachments_.push_back(place);
    if (op == Op::schema || op == Op::channel) keep(op, read(place.start + kRecordHead, length));
    if (op != Op::chunk) continue;
    chunks_.push_back({place, 0});
    const Chunk chunk = read_chunk(chunks_.size() - 1);
    if (chunk.messages.empty()) continue;
    if (messages_ == 0) from_ns_ = chunk.messages.front().time_ns;
    messages_ += chunk.messages.size();
    to_ns_ = chunks_.back().to_ns = chunk.messages.back().time_ns;
  }
}

std::size_t Reader::chunk_at(std::uint64_t time_ns) const noexcept {
  const auto at = std::ranges::find_if(chunks_, [&](const ChunkPlace& one) { return one.to_ns >= time_ns; });
  return static_cast<std::size_t>(at - chunks_.begin());
}

std::size_t Reader::last_chunk_before(double time_s,
                                      const std::function<std::optional<double>(const Chunk&)>& time_of) {
  std::size_t low = 0;
  for (std::size_t high = chunks(); high - low > 1;) {
    const std::size_t middle = low + (high - low) / 2;
    std::optional<double> begin_s;
    for (std::size_t i = middle; i < high && !begin_s; ++i) begin_s = time_of(read_chunk(i));
    (!begin_s || *begin_s > time_s ? high : low) = middle;
  }
  return low;
}

Chunk Reader::read_chunk(std::size_t number) {
  Chunk chunk;
  chunk.bytes = read(chunks_.at(number).start, chunks_.at(number).length);
  Cursor head(chunk.bytes);
  (void)head.raw(kRecordHead + 8 + 8 + 8);
  const auto crc = head.number<std::uint32_t>();
  if (!head.text().empty()) fail("a chunk is compressed");
  const auto records = head.raw(head.number<std::uint64_t>());
  if (crc_of(records) != crc) fail("the checksum of a chunk is wrong");
  for (Cursor rest(records); !rest.empty();) {
    const auto op = static_cast<Op>(rest.number<std::uint8_t>());
    const auto content = rest.raw(rest.number<std::uint64_t>());
    if (op != Op::message) continue;
    Cursor record(content);
    Message& message = chunk.messages.emplace_back();
    message.channel = record.number<std::uint16_t>();
    message.number = record.number<std::uint32_t>();
    message.time_ns = record.number<std::uint64_t>();
    (void)record.number<std::uint64_t>();
    message.data = content.last(content.size() - std::min<std::size_t>(content.size(), 2 + 4 + 8 + 8));
  }
  std::ranges::stable_sort(chunk.messages, {}, &Message::time_ns);
  return chunk;
}

std::map<std::string, std::string> Reader::attachments() {
  std::map<std::string, std::string> all;
  for (const Place& place : attachments_) {
    const auto bytes = read(place.start, place.length);
    if (bytes.size() < kRecordHead + sizeof(std::uint32_t)) fail("an attachment is too short");
    const std::span<const std::uint8_t> content = std::span<const std::uint8_t>(bytes).subspan(kRecordHead);
    Cursor record(content);
    (void)record.raw(16);
    const std::string name = record.text();
    (void)record.text();
    const std::string data = Cursor::text_of(record.raw(record.number<std::uint64_t>()));
    if (record.number<std::uint32_t>() != crc_of(content.first(content.size() - sizeof(std::uint32_t))))
      fail(fmt::format("the checksum of the attachment {} is wrong", name));
    all[name] = data;
  }
  return all;
}

}  // namespace subworld::mcap
