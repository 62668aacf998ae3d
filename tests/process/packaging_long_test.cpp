#include "process/process_test.hpp"

#include <filesystem>

namespace subworld::test {
namespace {

/// The packages of Debian, as `cpack -G DEB` makes them, and what `cmake --install` makes for developers.
class DebianPackage : public ProcessTest {};

// The root has the package and, below it, this machine's packages: neither the checkout nor another folder of it.
TEST_F(DebianPackage, RunsASceneInARootOfItsOwn) {
  const std::string build = std::filesystem::canonical(std::string(PROGRAMS_FOLDER) + "/..").string();
  const Ended made = finish({"/bin/sh", "-c", "cd \"$0\" && cpack -G DEB -B \"$1\"", build, folder_.path() + "/deb"});
  ASSERT_EQ(made.code, 0) << made.out << made.err;
  const std::string script =
      "set -e; cd \"$0\"; dpkg-deb -x deb/subworld_*_*.deb unpacked; mkdir -p system/usr system/proc system/tmp "
      "system/dev system/etc/subworld; cp unpacked/usr/lib/subworld/qos/fastdds.xml system/etc/subworld; "
      "for link in bin lib lib64; do ln -s usr/$link system/$link; done; "
      "mount -t overlay overlay -o lowerdir=unpacked/usr:/usr system/usr; mount --rbind /proc system/proc; "
      "mount --rbind /dev system/dev; [ -d system/usr/share/subworld/scenes ]; "
      "exec env -i /usr/sbin/chroot system /usr/bin/subworld run first --duration 0.3 --mode lockstep --domain $1 "
      "--out "
      "/tmp/out";
  const Ended ended = finish({"/usr/bin/unshare", "-m", "/bin/sh", "-c", script, folder_.path(), domain_.text()});
  if (ended.err.starts_with("unshare:") || ended.err.starts_with("mount:"))
    GTEST_SKIP() << "needs root, namespaces and overlays";
  EXPECT_EQ(ended.code, 0) << ended.err;
  const Json summary = Json::parse(read_text(folder_.path() + "/system/tmp/out/summary.json"), nullptr, false);
  EXPECT_EQ(summary["verdict"], "ok");
  EXPECT_NE(summary.dump().find("settings=/etc/subworld/fastdds.xml"), std::string::npos) << "survives an upgrade";

  const Ended facts = finish({"/bin/sh", "-c", "dpkg-deb -f \"$0\"/subworld_*_*.deb", folder_.path() + "/deb"});
  for (const char* needed : {"libfast", "libddsc0", "libbullet", "gnuplot-nox"})
    EXPECT_NE(facts.out.find(needed), std::string::npos) << facts.out;
}

// Built and run where the checkout is not there.
TEST_F(DebianPackage, ForDevelopersBuildsTheExamplesWhichRun) {
  const std::string place = folder_.path() + "/moved", first = folder_.path() + "/first";
  ASSERT_EQ(finish({"/usr/bin/cmake", "--install", std::string(PROGRAMS_FOLDER) + "/..", "--prefix", first}).code, 0);
  std::filesystem::rename(first, place);
  const std::string examples =
      folder_.write("run_examples", read_text(std::string(SOURCE_FOLDER) + "/tests/packages/run_examples"));
  const Ended ended = finish({"/usr/bin/unshare", "-m", "/bin/sh", "-c", "mount -t tmpfs none \"$0\" && exec \"$@\"",
                              SOURCE_FOLDER, "/bin/bash", examples, place, folder_.path() + "/built", domain_.text()});
  if (ended.err.starts_with("unshare:") || ended.err.starts_with("mount:")) GTEST_SKIP() << "needs root and namespaces";
  EXPECT_EQ(ended.code, 0) << ended.out << ended.err;
}

}  // namespace
}  // namespace subworld::test
