#include "io/records/mcap_writer.hpp"

#include "model/error.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace subworld::mcap {

namespace {

// A reader reads whole chunks, so that their size bounds the time to reach a moment.
constexpr std::size_t kChunk_bytes = 1U << 20U;
constexpr std::uint64_t kChunk_ns = 1'000'000'000;

std::uint32_t crc_of(std::uint32_t before, std::span<const std::uint8_t> bytes) {
  return static_cast<std::uint32_t>(crc32_z(before, bytes.data(), bytes.size()));
}

std::span<const std::uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace

Writer::Writer(const std::string& path) : path_(path), file_(open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644)) {
  if (file_ < 0)
    throw Error(ExitCode::failed, fmt::format("{}: {}; choose another file with --record", path, std::strerror(errno)));
  if (flock(file_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    close(std::exchange(file_, -1));
    throw Error(ExitCode::usage,
                fmt::format("{}: another run records into this file; choose another one with --record", path));
  }
  struct stat earlier {};
  keeps_earlier_ = fstat(file_, &earlier) == 0 && S_ISREG(earlier.st_mode) && earlier.st_size > 0;
  put(kMagic);
  Bytes header;
  header.text("");
  header.text("subworld");
  put_record(Op::header, header);
}

Writer::~Writer() {
  if (file_ >= 0) close(file_);
}

void Writer::put(std::span<const std::uint8_t> bytes) {
  crc_ = crc_of(crc_, bytes);
  written_ += bytes.size();
  if (keeps_earlier_) return held_.raw(bytes);
  write_out(bytes);
}

void Writer::write_out(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(file_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw Error(ExitCode::failed, fmt::format("{}: {}", path_, std::strerror(errno)));
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

void Writer::put_record(Op op, const Bytes& content) {
  Bytes head;
  head.number(static_cast<std::uint8_t>(op));
  head.number(static_cast<std::uint64_t>(content.size()));
  put(head.all());
  put(content.all());
}

std::uint16_t Writer::add_schema(const std::string& name, const std::string& encoding, std::string_view text) {
  const auto id = static_cast<std::uint16_t>(schemas_.size() + 1);
  Bytes& schema = schemas_.emplace_back();
  schema.number(id);
  schema.text(name);
  schema.text(encoding);
  schema.text(text);
  put_record(Op::schema, schema);
  return id;
}

std::uint16_t Writer::add_channel(std::uint16_t schema, const std::string& topic, const std::string& encoding) {
  const auto id = static_cast<std::uint16_t>(channels_.size() + 1);
  Bytes& channel = channels_.emplace_back();
  channel.number(id);
  channel.number(schema);
  channel.text(topic);
  channel.text(encoding);
  channel.number(std::uint32_t{0});
  put_record(Op::channel, channel);
  counts_[id] = 0;
  return id;
}

void Writer::write(std::uint16_t channel, std::uint32_t number, std::uint64_t time_ns,
                   std::span<const std::uint8_t> data) {
  const bool full = chunk_.size() > 0 && (chunk_.size() >= kChunk_bytes || time_ns > chunk_from_ns_ + kChunk_ns);
  if (full) flush();
  if (chunk_.size() == 0) chunk_from_ns_ = chunk_to_ns_ = time_ns;
  chunk_from_ns_ = std::min(chunk_from_ns_, time_ns);
  chunk_to_ns_ = std::max(chunk_to_ns_, time_ns);
  chunk_messages_[channel].emplace_back(time_ns, chunk_.size());
  ++counts_[channel];
  chunk_.number(static_cast<std::uint8_t>(Op::message));
  chunk_.number(static_cast<std::uint64_t>(2 + 4 + 8 + 8 + data.size()));
  chunk_.number(channel);
  chunk_.number(number);
  chunk_.number(time_ns);
  chunk_.number(time_ns);
  chunk_.raw(data);
}

std::uint64_t Writer::unwritten() const noexcept {
  std::uint64_t count = 0;
  for (const auto& [channel, messages] : chunk_messages_) count += messages.size();
  return count;
}

void Writer::flush() {
  if (chunk_.size() == 0) return;
  if (std::exchange(keeps_earlier_, false)) {
    if (ftruncate(file_, 0) != 0) throw Error(ExitCode::failed, fmt::format("{}: {}", path_, std::strerror(errno)));
    write_out(held_.all());
    held_.clear();
  }
  const std::uint64_t start = written_;
  const auto size = static_cast<std::uint64_t>(chunk_.size());
  Bytes head;
  head.number(chunk_from_ns_);
  head.number(chunk_to_ns_);
  head.number(size);
  head.number(crc_of(0, chunk_.all()));
  head.text("");
  head.number(size);
  Bytes front;
  front.number(static_cast<std::uint8_t>(Op::chunk));
  front.number(static_cast<std::uint64_t>(head.size() + size));
  front.raw(head.all());
  put(front.all());
  put(chunk_.all());
  const std::uint64_t chunk_length = written_ - start;

  Bytes offsets;
  const std::uint64_t indexes_start = written_;
  for (auto& [channel, messages] : chunk_messages_) {
    std::ranges::sort(messages);
    offsets.number(channel);
    offsets.number(written_);
    Bytes index;
    index.number(channel);
    index.number(static_cast<std::uint32_t>(16 * messages.size()));
    for (const auto& [time_ns, offset] : messages) {
      index.number(time_ns);
      index.number(offset);
    }
    put_record(Op::message_index, index);
  }

  Bytes& index = chunk_indexes_.emplace_back();
  index.number(chunk_from_ns_);
  index.number(chunk_to_ns_);
  index.number(start);
  index.number(chunk_length);
  index.number(static_cast<std::uint32_t>(offsets.size()));
  index.raw(offsets.all());
  index.number(written_ - indexes_start);
  index.text("");
  index.number(size);
  index.number(size);

  from_ns_ = chunk_indexes_.size() == 1 ? chunk_from_ns_ : std::min(from_ns_, chunk_from_ns_);
  to_ns_ = std::max(to_ns_, chunk_to_ns_);
  chunk_.clear();
  chunk_messages_.clear();
}

void Writer::attach(const std::string& name, const std::string& media_type, std::string_view data,
                    std::uint64_t time_ns) {
  flush();
  const std::uint64_t start = written_;
  Bytes content;
  content.number(time_ns);
  content.number(time_ns);
  content.text(name);
  content.text(media_type);
  content.number(static_cast<std::uint64_t>(data.size()));
  content.raw(bytes_of(data));
  content.number(crc_of(0, content.all()));
  put_record(Op::attachment, content);
  Bytes& index = attachment_indexes_.emplace_back();
  index.number(start);
  index.number(written_ - start);
  index.number(time_ns);
  index.number(time_ns);
  index.number(static_cast<std::uint64_t>(data.size()));
  index.text(name);
  index.text(media_type);
}

std::pair<std::uint64_t, std::uint64_t> Writer::put_group(const std::vector<Bytes>& records, Op op) {
  const std::uint64_t start = written_;
  for (const Bytes& record : records) put_record(op, record);
  return {start, written_ - start};
}

void Writer::finish() {
  flush();
  if (keeps_earlier_) return;
  Bytes end;
  end.number(crc_);
  put_record(Op::data_end, end);

  crc_ = 0;
  const std::uint64_t summary = written_;
  std::uint64_t count = 0;
  Bytes counts;
  for (const auto& [channel, messages] : counts_) {
    count += messages;
    counts.number(channel);
    counts.number(messages);
  }
  Bytes statistics;
  statistics.number(count);
  statistics.number(static_cast<std::uint16_t>(schemas_.size()));
  statistics.number(static_cast<std::uint32_t>(channels_.size()));
  statistics.number(static_cast<std::uint32_t>(attachment_indexes_.size()));
  statistics.number(std::uint32_t{0});  // metadata
  statistics.number(static_cast<std::uint32_t>(chunk_indexes_.size()));
  statistics.number(from_ns_);
  statistics.number(to_ns_);
  statistics.number(static_cast<std::uint32_t>(counts.size()));
  statistics.raw(counts.all());

  std::vector<Bytes> groups;
  const auto put_all = [&](const std::vector<Bytes>& records, Op op) {
    const auto [start, length] = put_group(records, op);
    if (length == 0) return;
    Bytes& offset = groups.emplace_back();
    offset.number(static_cast<std::uint8_t>(op));
    offset.number(start);
    offset.number(length);
  };
  put_all(schemas_, Op::schema);
  put_all(channels_, Op::channel);
  put_all({statistics}, Op::statistics);
  put_all(chunk_indexes_, Op::chunk_index);
  put_all(attachment_indexes_, Op::attachment_index);
  const std::uint64_t offsets = written_;
  put_group(groups, Op::summary_offset);

  Bytes footer;
  footer.number(static_cast<std::uint8_t>(Op::footer));
  footer.number(std::uint64_t{20});
  footer.number(summary);
  footer.number(offsets);
  put(footer.all());
  Bytes last;
  last.number(crc_);
  last.raw(kMagic);
  put(last.all());
  const int file = std::exchange(file_, -1);
  if (close(file) != 0) throw Error(ExitCode::failed, fmt::format("{}: {}", path_, std::strerror(errno)));
}

}  // namespace subworld::mcap
