#pragma once

#include "io/options/options.hpp"

#include <string>

namespace subworld {

/// Reserves a folder, a file of the temporary folder or a UDP port for one run and the life of this object.
class Claim {
 public:
  Claim() = default;
  ~Claim();
  Claim(const Claim&) = delete;
  Claim& operator=(const Claim&) = delete;

  /// 0, EWOULDBLOCK where another run holds it, or why its file cannot be opened.
  [[nodiscard]] int take_file(const std::string& name);
  /// False where another run holds this folder. A file system without locks refuses none.
  bool take_folder(const std::string& folder);
  /// 0, EADDRINUSE where another process of this network namespace has it, or another error number.
  [[nodiscard]] int take_port(int port);

 private:
  /// 0, or the error number.
  int lock(const char* path, int flags);
  int descriptor_ = -1;
};

/// A domain that no other run of this network namespace holds while the claim lives: `wanted`; or, where that is
/// negative, the first one that no program uses. Throws `Error` (middleware).
[[nodiscard]] int claim_domain(int wanted, Claim& claim);

/// Refuses a file of --record or --trace that holds something else than an earlier one: the run would replace it.
/// Throws `Error` (usage).
void check_outputs(const Options& options);

/// Reserves the folder that the user named for this run, and deletes the results of an earlier one; or makes a new one,
/// named after the scene and the time. Throws `Error` (usage, failed).
void claim_folder(std::string& folder, const std::string& scene, Claim& claim);

/// A run replaces the results in its folder. Throws `Error` (usage) where it goes on from those, or from none.
void check_resume(const Options& options);

}  // namespace subworld
