#pragma once

#include "io/records/mcap_writer.hpp"
#include "io/results/results.hpp"
#include "model/scene/scene.hpp"
#include "wire/message_memory.hpp"

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

namespace subworld {

/// What a recording holds, and what it lacks.
struct RecordingResult {
  std::string file;
  std::uint64_t sent = 0;                       ///< messages of all programs
  std::uint64_t recorded = 0;                   ///< of these
  std::uint64_t bytes = 0;                      ///< size of the file before its summary
  double cpu_s = 0.0;                           ///< of the recorder
  std::map<std::string, std::uint64_t> topics;  ///< messages recorded, by the topic in the file
  std::string fault;                            ///< why the file is not complete; empty: it is

  [[nodiscard]] std::uint64_t lost() const noexcept { return sent - recorded; }
};
void to_json(Json& json, const RecordingResult& result);

/// What is recorded.
struct RecordedRun {
  const Scene& scene;
  std::vector<std::string> flags;  ///< those that all programs share
  std::string dds;
  bool display = false;    ///< there is one
  std::string begun = {};  ///< the summary as far as it is known at the start: a killed run may have no other
  std::string out = {};    ///< folder of its results
};

/// A file in the format MCAP: messages of a run, scene and settings.
class RecordingFile {
 public:
  /// Throws `Error` (failed) where the file cannot be made.
  RecordingFile(const std::string& path, const RecordedRun& run);

  /// Throws `Error` (failed), as flush() and finish() do.
  void write(const std::string& topic, std::uint32_t number, std::int64_t time_ns, std::span<const std::uint8_t> cdr);
  void flush();
  /// Attaches a last text of JSON, and finishes the file, unless it has a fault.
  void finish(const char* name, const std::string& json);
  /// No more is written.
  void fail(const std::string& fault);
  /// Without `sent` and `cpu_s`.
  [[nodiscard]] RecordingResult result() const;
  [[nodiscard]] bool failed() const noexcept { return !result_.fault.empty(); }

 private:
  mcap::Writer writer_;
  RecordingResult result_;
  std::map<std::string, std::uint16_t> channels_;  ///< by topic
};

/// The recording of another host.
struct RecordingPart {
  std::string host;
  std::string file;
  double ahead_s = 0.0;  ///< its clock minus that of this machine
};

/// Records a run to a file: all messages of its programs, scene, settings and summary. The programs of this machine
/// copy their messages into shared memory; a thread of this process writes them.
class Recording {
 public:
  /// Throws `Error` (failed) where the file cannot be made.
  Recording(const std::string& file, const RecordedRun& run, MessageMemory& memory);
  /// Ends the thread.
  ~Recording();
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  /// Before the start, where other hosts have recordings too: the messages of this machine go to a part of their own.
  void divide(const std::string& part_file, const RecordedRun& run);
  void start();
  /// The programs have ended: writes what is left of their messages, and merges the parts.
  [[nodiscard]] RecordingResult drain(const std::vector<RecordingPart>& others = {});
  /// Attaches the summary of the run, and finishes the file. Throws `Error` (failed).
  void finish(const std::string& summary_file);
  /// The same for a part, which has its own figures in the place of the summary.
  void finish_part();

 private:
  void work();
  void write_arrived(bool last);
  [[nodiscard]] RecordingResult figures() const;  ///< of this machine

  MessageMemory& memory_;
  std::int64_t to_wall_ns_;  ///< of the steady clock
  RecordingFile file_;
  std::unique_ptr<RecordingFile> part_;
  RecordingFile* own_ = &file_;  ///< for the messages of this machine
  double cpu_s_ = 0.0;
  std::vector<KeptMessage> arrived_;
  std::atomic<bool> ended_ = false;
  std::thread thread_;
};

/// Place of a program in the memory of a run's messages, and their number; `user` -1: none.
[[nodiscard]] std::size_t place_of_messages(const std::string& program, int user);
[[nodiscard]] std::size_t places_of_messages(int users);
/// The sizes of the programs' rings: what a program sends in a second or more. A recording needs whole messages.
[[nodiscard]] std::vector<std::size_t> sizes_of_messages(const Scene& scene, bool display, bool recorded);

/// Whether a path leads to a file below the folder that it begins in.
[[nodiscard]] bool stays_inside(const std::filesystem::path& file);

inline constexpr const char* kSceneAttachment = "scene.yaml";
inline constexpr const char* kSettingsAttachment = "settings.json";
inline constexpr const char* kSummaryAttachment = "summary.json";
inline constexpr const char* kBegunAttachment = "begun.json";

}  // namespace subworld
