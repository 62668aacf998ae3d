#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace subworld::test {

/// A short lock-step run of a scene in deploy/scenes, for which both the lab and the real programs give a state hash.
struct HashCase {
  std::string scene;
  std::string scheme;
  int users = 1;
  double latency_s = 0.0;
};

/// Every scene in `folder` with each scheme, each number of users that it declares, at most two, and with and without
/// delay; ordered by name. If `scenes` are given: only those.
[[nodiscard]] std::vector<HashCase> hash_cases(const std::string& folder, const std::vector<std::string>& scenes = {});
/// In the format of the table: scene,scheme,users,latency_s.
[[nodiscard]] std::string to_text(const HashCase& one);
/// Flags of `subworld run`, after the scene.
[[nodiscard]] std::vector<std::string> flags_of(const HashCase& one);
/// Hash of the lab's run in one process, in the format of summary.json.
[[nodiscard]] std::string in_process_hash(const HashCase& one, const std::string& folder);

}  // namespace subworld::test
