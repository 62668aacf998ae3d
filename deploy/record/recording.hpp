#pragma once

#include "io/mcap_writer.hpp"
#include "io/results.hpp"
#include "model/scene.hpp"
#include "wire/recording_memory.hpp"

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
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

/// Records a run to a file in the format MCAP: all messages of its programs, scene, settings and summary. The programs
/// copy their messages into shared memory (wire/recording_memory); a thread of this process writes them.
class Recording {
 public:
  /// `flags`: those of the run that all programs share. `display`: there is one. Throws `Error` (failed) where the file
  /// or the memory cannot be made.
  Recording(const std::string& file, const Scene& scene, const std::vector<std::string>& flags, const std::string& dds,
            bool display);
  /// Ends the thread.
  ~Recording();
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  [[nodiscard]] const RecordingMemory& memory() const noexcept { return memory_; }
  void start();
  /// The programs have ended: writes what is left of their messages.
  [[nodiscard]] RecordingResult drain();
  /// Attaches the summary of the run, and finishes the file. Throws `Error` (failed).
  void finish(const std::string& summary_file);

 private:
  void work();
  void write_arrived(bool last);
  [[nodiscard]] std::uint16_t channel_of(std::size_t topic, std::uint32_t user);
  void attach_scene(const Scene& scene, const std::vector<std::string>& flags, const std::string& dds);

  RecordingMemory memory_;
  mcap::Writer writer_;
  RecordingResult result_;
  std::map<std::size_t, std::uint16_t> schemas_;  // by topic
  struct Channel {
    std::uint16_t id = 0;
    std::string topic;
  };
  std::map<std::pair<std::size_t, std::uint32_t>, Channel> channels_;
  std::vector<RecordedMessage> arrived_;
  std::atomic<bool> ended_ = false;
  std::thread thread_;
};

/// Relative paths of the files that a scene's text names.
[[nodiscard]] std::vector<std::string> files_of_scene(const std::string& text);

inline constexpr const char* kSceneAttachment = "scene.yaml";
inline constexpr const char* kSettingsAttachment = "settings.json";
inline constexpr const char* kSummaryAttachment = "summary.json";

}  // namespace subworld
