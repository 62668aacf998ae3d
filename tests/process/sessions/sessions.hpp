#pragma once

#include "process/process_test.hpp"

#include <filesystem>
#include <string>

namespace subworld::test {

/// Sessions of three hosts, all of which are this machine.
class Sessions : public ProcessTest {
 protected:
  /// The library's session of three hosts on loopback, with one passage replaced.
  [[nodiscard]] std::string session(const std::string& passage = "", const std::string& by = "") const {
    std::string text = read_text(std::string(SCENES_FOLDER) + "/../sessions/three_hosts.yaml");
    const auto replace = [&](const std::string& from, const std::string& to, bool all) {
      std::size_t at = text.find(from);
      EXPECT_NE(at, std::string::npos) << from;
      for (; at != std::string::npos; at = all ? text.find(from, at + to.size()) : std::string::npos)
        text.replace(at, from.size(), to);
    };
    for (const char* address : {"address: 10.0.0.1", "address: 10.0.0.2", "address: 10.0.0.3"})
      replace(address, "address: 127.0.0.1", true);
    replace("interface: eth0", "interface: lo", true);
    replace("duration: 1}", "duration: 0.2}", false);
    replace("hosts:\n", "domain: " + domain_.text() + "\nhosts:\n", false);
    if (!passage.empty()) replace(passage, by, false);
    return folder_.write("session.yaml", text);
  }
  /// A checkout of Subworld whose programs are those under test.
  static void make_checkout(const std::string& folder, const std::string& programs = "/build/release/bin") {
    const std::filesystem::path place = folder + programs;
    std::filesystem::create_directories(place.parent_path());
    std::filesystem::create_directory_symlink(PROGRAMS_FOLDER, place);
  }
  [[nodiscard]] std::string write_script(const std::string& name, const std::string& commands) const {
    std::string file = folder_.write(name, "#!/bin/sh\n" + commands + "\n");
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
    return file;
  }
  /// Network namespaces are permitted.
  [[nodiscard]] bool has_namespaces() const { return finish({"/usr/bin/unshare", "--net", "/bin/true"}).code == 0; }
  [[nodiscard]] std::string hash_of_one_host() const {
    EXPECT_EQ(run(scene("lift"), {"--duration", "0.2"}).code, 0);
    return summary()["state_hash"];
  }
  [[nodiscard]] Words up(const std::string& file, const std::string& out, const Words& flags = {}) const {
    Words words{program("subworld"), "up", file, "--out", out};
    words.insert(words.end(), flags.begin(), flags.end());
    return words;
  }
  void expect_error(const std::string& file, const std::string& text) const {
    const Ended ended = finish(up(file, folder_.path() + "/wrong"));
    EXPECT_EQ(ended.code, 2) << ended.err;
    EXPECT_NE(ended.err.find(text), std::string::npos) << ended.err;
  }
};

/// In the place of ssh stands a shell on this machine, with a folder of its own for each destination.
class SessionsByShell : public Sessions {
 protected:
  [[nodiscard]] std::string home(const std::string& destination) const {
    std::filesystem::create_directories(folder_.path() + "/home/" + destination);
    return folder_.path() + "/home/" + destination;
  }
  [[nodiscard]] std::string ssh() const {
    return write_script("ssh", "while :; do case $1 in -o) shift 2;; -*) shift;; *) break;; esac; done\ncd " +
                                   folder_.path() + "/home/$1 && shift && exec sh -c \"$*\"");
  }
};

}  // namespace subworld::test
