#pragma once

#include <string>
#include <vector>

namespace subworld {

/// What `subworld keys make` is asked for.
struct KeysRequest {
  std::string folder;
  int users = 1;
  int days = 365;  ///< for which the keys are valid
  /// Topics whose contents are also hidden, or kAllTopics: all that is sent, discovery included. Each message of each
  /// topic is signed.
  std::vector<std::string> encrypt = {};
};
inline constexpr const char* kAllTopics = "all";

/// The topics that may be encrypted one by one.
[[nodiscard]] std::vector<std::string> topic_names();

/// Makes an authority, a certificate with a key for each role of a run, and the signed documents that say what is
/// protected and what each role may publish. In a folder with keys, makes those of further users. Uses the program
/// openssl. Throws `Error` (usage) where all users have keys already, and (failed) where openssl fails.
void make_keys(const KeysRequest& request);

/// The topics that are encrypted with the keys of a folder, or kAllTopics.
[[nodiscard]] std::vector<std::string> encrypted_topics(const std::string& folder);

/// Users for whom a folder has keys.
[[nodiscard]] int users_with_keys(const std::string& folder);

/// What is wrong with the keys of a folder, in words; empty: nothing. `roles`: whose, as "haptic_sim_0"; empty: all.
[[nodiscard]] std::vector<std::string> key_faults(const std::string& folder,
                                                  const std::vector<std::string>& roles = {});

}  // namespace subworld
