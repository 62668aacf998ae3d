#pragma once

#include "io/options/options.hpp"
#include "io/results/program_results.hpp"
#include "rt/cyclic.hpp"
#include "world_sim/checkpoint/checkpoint.hpp"
#include "world_sim/world.hpp"

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace subworld {

/// Writes checkpoints of a world beside its loop. When one is due, the loop copies the states that may have changed
/// since the last one into a buffer: those of awake bodies, and of those that fell asleep meanwhile. A thread without a
/// priority writes the buffer to a file beside the older one, flushes it to the disk and renames it. While the thread
/// writes, the loop skips what is due.
class CheckpointWriter {
 public:
  using Say = std::function<void(std::string)>;

  /// Writes nothing where `options` has no folder, or in lock-step. `say` is called by the thread when a checkpoint
  /// cannot be written, once until one can. Without --resume, old checkpoints of the folder are removed.
  CheckpointWriter(const Options& options, const Scene& scene, const World& world, std::uint64_t session, Say say);
  ~CheckpointWriter();
  CheckpointWriter(const CheckpointWriter&) = delete;
  CheckpointWriter& operator=(const CheckpointWriter&) = delete;

  /// After each cycle, from the loop. `absences`: so far; `cycle_cost_s`: what the cycle took without this. Allocates
  /// nothing for up to kUsualAbsences, never waits.
  void observe(const World& world, const std::vector<Absence>& absences, double cycle_cost_s);
  /// After the last cycle: writes the state at the end.
  void finish(const World& world, const std::vector<Absence>& absences);
  /// After finish(): number, size and cost; nothing where none are written.
  [[nodiscard]] std::optional<CheckpointResult> result() const;

 private:
  static constexpr std::size_t kUsualAbsences = 256;
  enum class Buffer : std::uint8_t { free, full };

  [[nodiscard]] bool writes() const noexcept { return thread_.joinable(); }
  void note_slept(const World& world) noexcept;
  void copy(const World& world, const std::vector<Absence>& absences);
  void copy(const World& world, BodyId id) noexcept;
  void work();
  void write_out();

  const std::string folder_;
  const double interval_s_;
  const Say say_;
  WorldCheckpoint buffer_;
  std::atomic<Buffer> state_{Buffer::free};
  std::vector<BodyId> slept_;  ///< since the last copy
  bool copies_all_ = true;     ///< the next copy does
  double next_s_ = 0.0;
  double copies_s_ = 0.0, cycles_s_ = 0.0;  ///< sums of the loop
  MeanMax copy_s_;
  std::uint64_t skipped_ = 0;

  // Of the thread, and after its end of all.
  std::string bytes_;
  std::uint64_t written_ = 0, failed_ = 0, number_ = 0;
  double newest_s_ = 0.0;
  MeanMax write_s_;
  std::string fault_;   ///< the first
  bool fails_ = false;  ///< the newest could not be written

  std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace subworld
