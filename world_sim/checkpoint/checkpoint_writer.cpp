#include "world_sim/checkpoint/checkpoint_writer.hpp"

#include "rt/scheduling.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <utility>

namespace subworld {

namespace {

constexpr double kPoll_s = 0.02;

/// The errno of what failed; 0: the file is on the disk, completely.
int write_file(const std::string& path, const std::string& bytes) {
  const std::string unfinished = path + ".part";
  const int file = open(unfinished.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) return errno;
  int error = 0;
  for (std::size_t done = 0; error == 0 && done < bytes.size();) {
    const ssize_t written = write(file, bytes.data() + done, bytes.size() - done);
    if (written > 0) done += static_cast<std::size_t>(written);
    if (written < 0 && errno != EINTR) error = errno;
  }
  if (error == 0 && fsync(file) != 0) error = errno;
  if (close(file) != 0 && error == 0) error = errno;
  if (error == 0 && std::rename(unfinished.c_str(), path.c_str()) != 0) error = errno;
  if (error != 0) unlink(unfinished.c_str());
  return error;
}

double interval_of(const Options& options, const Scene& scene) {
  return options.out.empty() || scene.settings.mode != Mode::realtime ? 0.0 : options.checkpoint_s;
}

}  // namespace

CheckpointWriter::CheckpointWriter(const Options& options, const Scene& scene, const World& world,
                                   std::uint64_t session, Say say)
    : folder_(options.out), interval_s_(interval_of(options, scene)), say_(std::move(say)) {
  if (!folder_.empty() && options.resume.empty()) {
    for (const std::uint64_t number : {0U, 1U}) unlink(checkpoint_file(folder_, number).c_str());
  }
  if (interval_s_ <= 0.0) return;
  number_ = next_checkpoint(folder_);
  buffer_.settings = agreed_settings(scene);
  buffer_.session = session;
  buffer_.engine.reserve(64);
  buffer_.states = scene.initial;
  buffer_.asleep.resize(scene.bodies.size());
  buffer_.devices.resize(scene.users.size());
  buffer_.absences.reserve(kUsualAbsences);
  slept_.reserve(scene.bodies.size());
  next_s_ = world.facts().time_s + interval_s_;
  encode(buffer_, bytes_);  // the thread takes its memory now
  thread_ = std::thread([this] { work(); });
}

CheckpointWriter::~CheckpointWriter() {
  if (!writes()) return;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void CheckpointWriter::observe(const World& world, const std::vector<Absence>& absences, double cycle_cost_s) {
  if (!writes()) return;
  cycles_s_ += cycle_cost_s;
  const TimePoint begin = Clock::now();
  note_slept(world);
  const bool due = world.facts().time_s >= next_s_;
  if (due) {
    next_s_ = std::max(next_s_ + interval_s_, world.facts().time_s);
    if (state_.load() == Buffer::free) {
      copy(world, absences);
    } else {
      ++skipped_;
    }
  }
  const double took_s = to_seconds(Clock::now() - begin);
  copies_s_ += took_s;
  if (due) copy_s_.add(took_s);
}

void CheckpointWriter::note_slept(const World& world) noexcept {
  for (const BodyId id : world.engine().fell_asleep()) {
    if (slept_.size() == slept_.capacity()) {
      copies_all_ = true;
      return;
    }
    slept_.push_back(id);
  }
}

void CheckpointWriter::copy(const World& world, BodyId id) noexcept {
  buffer_.states[index(id)] = world.engine().state(id);
  buffer_.asleep[index(id)] = world.engine().asleep(id) ? 1 : 0;
}

void CheckpointWriter::copy(const World& world, const std::vector<Absence>& absences) {
  copy_accounts(world, buffer_);
  if (std::exchange(copies_all_, false)) {
    for (std::uint32_t i = 0; i < buffer_.states.size(); ++i) copy(world, BodyId{i});
  } else {
    for (const BodyId id : slept_) copy(world, id);
    for (const BodyId id : world.engine().awake()) copy(world, id);
  }
  buffer_.absences = absences;
  slept_.clear();
  state_.store(Buffer::full);
}

void CheckpointWriter::work() {
  leave_realtime();
  std::unique_lock lock(mutex_);
  while (!wake_.wait_for(lock, std::chrono::duration<double>(kPoll_s), [this] { return stop_; })) {
    if (state_.load() == Buffer::full) write_out();
  }
  if (state_.load() == Buffer::full) write_out();
}

void CheckpointWriter::write_out() {
  const TimePoint begin = Clock::now();
  encode(buffer_, bytes_);
  const double time_s = buffer_.time_s;
  state_.store(Buffer::free);
  const std::string path = checkpoint_file(folder_, number_);
  const int error = write_file(path, bytes_);
  write_s_.add(to_seconds(Clock::now() - begin));
  if (error == 0) {
    ++written_;
    ++number_;  // a checkpoint that fails leaves the newest alone
    newest_s_ = time_s;
    fails_ = false;
    return;
  }
  ++failed_;
  if (fault_.empty()) fault_ = fmt::format("{}: {}", path, std::strerror(error));
  if (std::exchange(fails_, true)) return;
  say_(
      fmt::format("the checkpoint cannot be written: {}: {}; the run goes on, and resumes from an older checkpoint at "
                  "best",
                  path, std::strerror(error)));
}

void CheckpointWriter::finish(const World& world, const std::vector<Absence>& absences) {
  if (!writes()) return;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_one();
  thread_.join();
  note_slept(world);
  if (state_.load() == Buffer::free && world.facts().finite) {
    copy(world, absences);
    write_out();
  }
}

std::optional<CheckpointResult> CheckpointWriter::result() const {
  if (interval_s_ <= 0.0) return {};
  return CheckpointResult{.interval_s = interval_s_,
                          .written = written_,
                          .skipped = skipped_,
                          .failed = failed_,
                          .bytes = bytes_.size(),
                          .newest_s = newest_s_,
                          .copy_s = copy_s_,
                          .write_s = write_s_,
                          .cycle_share = cycles_s_ > 0.0 ? copies_s_ / cycles_s_ : 0.0,
                          .fault = fault_};
}

}  // namespace subworld
