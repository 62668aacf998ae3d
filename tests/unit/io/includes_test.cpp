#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace {

using Names = std::set<std::string>;

/// For each room, the rooms whose files it may include.
const std::map<std::string, Names> kMayInclude{
    {"model", {"model"}},
    {"plugin", {"model", "plugin"}},
    {"physics", {"model", "plugin", "physics"}},
    {"coupling", {"model", "physics", "coupling"}},
    {"wire", {"model", "wire"}},
    {"rt", {"rt"}},
    {"io", {"model", "rt", "io"}},
    {"report", {"model", "io", "report"}},
    {"program", {"model", "physics", "wire", "rt", "io", "program"}},
    {"world_sim", {"model", "physics", "coupling", "wire", "rt", "io", "program", "world_sim"}},
    {"haptic_sim", {"model", "physics", "coupling", "wire", "rt", "io", "program", "haptic_sim"}},
    {"device_sim", {"model", "physics", "coupling", "wire", "rt", "io", "program", "plugin", "device_sim"}},
    {"gui_headless", {"model", "physics", "coupling", "wire", "rt", "io", "program", "gui_headless"}},
    {"examples", {"examples", "model", "physics", "coupling", "wire", "io", "world_sim", "haptic_sim", "device_sim"}},
    {"deploy", {"model", "physics", "coupling", "wire", "rt", "io", "report", "device_sim", "deploy"}},
};

/// A foreign library: the pattern of its includes, and the files that may have them.
struct Foreign {
  const char* name;
  std::regex includes;
  std::regex files;
};

const std::vector<Foreign>& foreign() {
  static const std::vector<Foreign> kAll{
      {"Fast DDS", std::regex("(fastdds|fastrtps|fastcdr)/.*"), std::regex("common/wire/fastdds/.*")},
      {"Cyclone DDS", std::regex("dds/.*"), std::regex("common/wire/cyclonedds/.*")},
      {"Bullet", std::regex("(bullet/|BulletCollision|BulletDynamics|LinearMath|bt[A-Z]).*"),
       std::regex("common/physics/bullet/.*")},
      {"ODE", std::regex("ode/.*"), std::regex("common/physics/ode/.*")},
      {"Havok", std::regex("havok\\.h"), std::regex("common/physics/havok/.*")},
      {"PhysX", std::regex("physx\\.h"), std::regex("common/physics/physx/.*")},
      {"Rapier", std::regex("rapier\\.h"), std::regex("common/physics/rapier/.*")},
      {"yaml-cpp", std::regex("yaml-cpp/.*"), std::regex("common/model/scene/yaml_tree\\.cpp")},
      {"Assimp", std::regex("assimp/.*"), std::regex("common/model/scene/mesh_file\\.cpp")},
      {"Eigen", std::regex("Eigen/.*"), std::regex("(common/(model|physics|coupling|wire)|[a-z]+_[a-z]+)/.*")},
      {"JSON", std::regex("nlohmann/.*"), std::regex("common/io/.*|device_sim/drivers/haply\\.cpp")},
      {"libwebsockets", std::regex("libwebsockets\\.h"),
       std::regex("gui_headless/live/(session|server)\\.cpp|device_sim/drivers/haply\\.cpp")},
      {"command lines", std::regex("CLI/.*"), std::regex("common/io/options/(command_line|manual)\\.cpp")},
      {"zlib", std::regex("zlib\\.h"), std::regex("(common/io/records/mcap_.*|gui_headless/picture)\\.cpp")},
      {"PNG", std::regex("png\\.h"), std::regex("gui_headless/picture\\.cpp")},
  };
  return kAll;
}

std::string room_of(const std::string& file) {
  const bool inner = file.starts_with("common/") || file.starts_with("deploy/examples/");
  const std::string rest = inner ? file.substr(7) : file;
  return rest.substr(0, rest.find('/'));
}

/// The includes of a source that break the rules, one line each. `file` is relative to the source folder.
std::vector<std::string> offences(const std::string& file, const std::string& text) {
  static const std::regex kInclude(R"(^\s*#\s*include\s*([<"])([^>"]+)[>"])");
  std::vector<std::string> found;
  const std::string room = room_of(file);
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::smatch match;
    if (!std::regex_search(line, match, kInclude)) continue;
    const std::string included = match[2];
    const auto report = [&](const std::string& why) {
      found.push_back(file + ":" + std::to_string(number) + ": " + included + ": " + why);
    };
    if (included.find("..") != std::string::npos) report("leaves its room by a relative path");
    const std::string path = included.starts_with("common/") ? included.substr(7) : included;
    const std::string other = path.find('/') == std::string::npos ? room : path.substr(0, path.find('/'));
    const bool ours = kMayInclude.contains(other) || other == "tests" || other == "support";
    if (ours && match[1] == "\"" && !kMayInclude.at(room).contains(other)) report(room + " may not know " + other);
    static const std::regex kScheme("coupling/schemes/(direct|paper|reduced)/.*");
    if (std::regex_match(path, kScheme) && room != "coupling") report("only coupling may know which schemes there are");
    for (const Foreign& library : foreign()) {
      if (std::regex_match(included, library.includes) && !std::regex_match(file, library.files))
        report(std::string(library.name) + " may not be known here");
    }
  }
  return found;
}

std::vector<std::filesystem::path> sources() {
  std::vector<std::filesystem::path> files;
  const std::filesystem::path root = SOURCE_FOLDER;
  for (const char* folder : {"common", "world_sim", "haptic_sim", "device_sim", "gui_headless", "deploy"}) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
      const auto extension = entry.path().extension();
      if (extension == ".cpp" || extension == ".hpp") files.push_back(entry.path().lexically_relative(root));
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

TEST(Includes, KeepToTheRooms) {
  Names rooms;
  for (const auto& file : sources()) {
    rooms.insert(room_of(file.string()));
    std::ifstream stream(std::filesystem::path(SOURCE_FOLDER) / file);
    const std::string text(std::istreambuf_iterator<char>(stream), {});
    ASSERT_TRUE(kMayInclude.contains(room_of(file.string()))) << file << " is in a room without a rule";
    for (const std::string& offence : offences(file.string(), text)) ADD_FAILURE() << offence;
  }
  Names ruled;
  for (const auto& [room, others] : kMayInclude) ruled.insert(room);
  EXPECT_EQ(rooms, ruled);
}

struct MadeUp {
  const char* file;
  const char* line;
  bool allowed;
};

/// The rules can fail, and fail for the right lines.
TEST(Includes, MadeUpSourcesAreJudged) {
  const std::vector<MadeUp> cases{
      {"common/model/a.hpp", "#include \"model/body.hpp\"", true},
      {"common/model/a.hpp", "#include <Eigen/Core>", true},
      {"common/model/a.hpp", "#include <vector>", true},
      {"common/model/a.hpp", "#include \"wire/bus.hpp\"", false},
      {"common/model/a.hpp", "#include \"../wire/bus.hpp\"", false},
      {"common/model/a.hpp", "#include \"common/wire/bus.hpp\"", false},
      {"common/model/a.cpp", "  #  include <yaml-cpp/yaml.h>", false},
      {"common/model/scene/yaml_tree.cpp", "#include <yaml-cpp/yaml.h>", true},
      {"common/model/a.cpp", "#include <assimp/scene.h>", false},
      {"common/physics/a.cpp", "#include \"coupling/schemes/scheme.hpp\"", false},
      {"common/physics/engine.cpp", "#include <btBulletDynamicsCommon.h>", false},
      {"common/physics/bullet/shapes.cpp", "#include <btBulletDynamicsCommon.h>", true},
      {"common/coupling/a.cpp", "#include \"physics/engine.hpp\"", true},
      {"common/coupling/a.cpp", "#include \"wire/bus.hpp\"", false},
      {"common/coupling/schemes/a.cpp", "#include \"coupling/schemes/paper/paper.hpp\"", true},
      {"haptic_sim/a.cpp", "#include \"coupling/schemes/paper/paper.hpp\"", false},
      {"haptic_sim/a.cpp", "#include \"coupling/schemes/scheme.hpp\"", true},
      {"common/coupling/a.cpp", "#include \"rt/cyclic.hpp\"", false},
      {"common/wire/bus.cpp", "#include <fastdds/dds/topic/Topic.hpp>", false},
      {"common/wire/fastdds/peers.hpp", "#include <fastdds/dds/topic/Topic.hpp>", true},
      {"common/wire/fastdds/peers.hpp", "#include <dds/dds.h>", false},
      {"common/wire/codec/codec.cpp", "#include \"rt/cyclic.hpp\"", false},
      {"common/rt/a.cpp", "#include \"model/error.hpp\"", false},
      {"common/io/a.cpp", "#include \"wire/bus.hpp\"", false},
      {"common/report/page.hpp", "#include \"io/results/results.hpp\"", true},
      {"common/report/page.hpp", "#include \"rt/cyclic.hpp\"", false},
      {"world_sim/a.cpp", "#include \"report/page.hpp\"", false},
      {"world_sim/a.cpp", "#include \"wire/bus.hpp\"", true},
      {"world_sim/a.cpp", "#include \"haptic_sim/loops/run.hpp\"", false},
      {"device_sim/a.cpp", "#include \"gui_headless/picture.hpp\"", false},
      {"gui_headless/a.cpp", "#include \"picture.hpp\"", true},
      {"deploy/a.cpp", "#include \"world_sim/world.hpp\"", false},
      {"world_sim/a.cpp", "#include \"tests/support/bodies.hpp\"", false},
      {"world_sim/a.cpp", "// #include \"haptic_sim/loops/run.hpp\"", true},
  };
  for (const MadeUp& one : cases) {
    EXPECT_EQ(offences(one.file, std::string(one.line) + "\n").empty(), one.allowed) << one.file << ": " << one.line;
  }
}

}  // namespace
