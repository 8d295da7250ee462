// Time from tiles to a scene for ray casting: a whole tileset from disk, from a server with 20 ms latency, and from the
// resulting cache, compared with the time to decode the same contents from memory.
//
//   tiles_benchmark [--runs N] [TILESET.JSON...]
//
// Without files: the tilesets in $TILEFLIGHT_TEST_DATA. Each line is the fastest of N runs (default 3), measured in
// turns. The server is a separate process on the same cores and takes processor time from the reader, so the ratio is
// given as measured and with the server's processor time, divided by the cores, subtracted. Memory is the peak of the
// run minus what the process held before.

#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

#include "tests/test_data.h"
#include "tileflight/tiles/fetch/test_http_server.h"
#include "tileflight/tiles/tile_content/content.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/world/scene/scene.h"

namespace {

namespace fs = std::filesystem;
using namespace tileflight;

constexpr std::chrono::milliseconds kLatency{20};

struct Cost {
  double wall_s = 1e300;
  double processor_s = 0.0;
  double scene_s = 0.0;   ///< part of wall_s: construction of the scene
  double server_s = 0.0;  ///< processor time of the server during the run
  double memory_mb = 0.0;
};

double processor_s() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * t.tv_usec; };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double status_mb(const char* key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind(key, 0) == 0) return std::stod(line.substr(std::strlen(key) + 1)) / 1024.0;
  }
  return 0.0;
}

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// Keeps the bytes read.
class KeepingSource : public fetch::TileSource {
 public:
  explicit KeepingSource(const fs::path& tileset) : inner_(tileset) {}

  std::string root_uri() const override { return inner_.root_uri(); }
  std::vector<std::byte> read(const std::string& uri) override {
    std::vector<std::byte> bytes = inner_.read(uri);
    const std::lock_guard lock(mutex_);
    kept_[uri] = bytes;
    return bytes;
  }
  std::optional<std::uintmax_t> size(const std::string& uri) override { return inner_.size(uri); }

  const std::map<std::string, std::vector<std::byte>>& kept() const { return kept_; }

 private:
  fetch::FolderSource inner_;
  std::mutex mutex_;
  std::map<std::string, std::vector<std::byte>> kept_;
};

std::string bytes_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// Serves a folder from memory with 20 ms latency, in its own process.
class SlowServer {
 public:
  explicit SlowServer(const fs::path& folder) {
    int port_pipe[2];
    if (pipe(port_pipe) != 0) throw std::runtime_error("no pipe for the server");
    process_ = fork();
    if (process_ == 0) serve(folder, port_pipe[1]);
    close(port_pipe[1]);
    if (process_ < 0 || ::read(port_pipe[0], &port_, sizeof port_) != sizeof port_)
      throw std::runtime_error("the server did not start");
    close(port_pipe[0]);
  }
  SlowServer(const SlowServer&) = delete;
  SlowServer& operator=(const SlowServer&) = delete;
  ~SlowServer() {
    kill(process_, SIGTERM);
    waitpid(process_, nullptr, 0);
  }

  std::string url(const std::string& path) const { return "http://127.0.0.1:" + std::to_string(port_) + "/" + path; }

  /// Since its start: user and system time of /proc/PID/stat.
  double processor_s() const {
    std::ifstream file("/proc/" + std::to_string(process_) + "/stat");
    std::string line;
    std::getline(file, line);
    std::istringstream fields(line.substr(line.rfind(')') + 2));
    std::string skipped;
    for (int i = 0; i < 11; ++i) fields >> skipped;
    double user = 0.0, system = 0.0;
    fields >> user >> system;
    return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
  }

 private:
  [[noreturn]] static void serve(const fs::path& folder, int port_pipe) {
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    const std::map<std::string, std::string> files = files_of(folder);
    const fetch::test_support::TestHttpServer server(
        [&files](const fetch::test_support::ServedRequest& request, fetch::test_support::ServedConnection& connection) {
          connection.wait(kLatency);
          const auto file = files.find(request.path().substr(1));
          return file != files.end() ? connection.answer(200, file->second, {"Cache-Control: max-age=3600"})
                                     : connection.answer(404, "no such file");
        });
    const int port = server.port();
    if (write(port_pipe, &port, sizeof port) != sizeof port) _exit(1);
    while (true) pause();
  }

  static std::map<std::string, std::string> files_of(const fs::path& folder) {
    std::map<std::string, std::string> files;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
      if (entry.is_regular_file()) files[fs::relative(entry.path(), folder).string()] = bytes_of(entry.path());
    return files;
  }

  pid_t process_ = -1;
  int port_ = 0;
};

/// A measured task. `work` returns the seconds spent on its scene.
struct Task {
  std::string name;
  std::function<double()> work;
  std::function<void()> before = {};
  Cost best = {};  ///< of the fastest run, without its scene

  void run(const SlowServer& server) {
    if (before) before();
    std::ofstream("/proc/self/clear_refs") << "5";
    const double held_mb = status_mb("VmRSS"), begin_s = now_s(), begin_processor_s = processor_s();
    const double begin_server_s = server.processor_s();
    const double scene_s = work(), wall_s = now_s() - begin_s;
    if (wall_s - scene_s < best.wall_s - best.scene_s)
      best = {wall_s, processor_s() - begin_processor_s, scene_s, server.processor_s() - begin_server_s,
              status_mb("VmHWM") - held_mb};
  }
};

/// Reads a place; throws if tiles are missing.
tileset::LoadedTiles read(const std::string& source, bool textures, const fs::path& cache = {}) {
  tileset::LoadOptions options;
  options.textures = textures;
  options.source.cache_folder = cache;
  tileset::LoadedTiles loaded = tileset::load_region(source, options);
  if (!loaded.complete) throw std::runtime_error(source + ": " + loaded.failures.at(0));
  return loaded;
}

/// Reads a place and builds its scene; returns the seconds of the latter.
double load(const std::string& source, bool textures, const fs::path& cache = {}) {
  tileset::LoadedTiles loaded = read(source, textures, cache);
  const double begin_s = now_s();
  const scene::Scene scene(std::move(loaded.meshes));
  return now_s() - begin_s;
}

/// Decodes contents from memory on all cores and discards the results.
void decode(const std::map<std::string, std::vector<std::byte>>& kept, const std::vector<std::string>& contents,
            bool textures) {
  tile_content::ContentOptions options;
  options.textures = textures;
  tbb::parallel_for(std::size_t{0}, contents.size(), [&](std::size_t i) {
    tile_content::ContentOptions own = options;
    const std::string folder = contents[i].substr(0, contents[i].rfind('/') + 1);
    own.read_resource = [&](const std::string& uri) { return kept.at(folder + uri); };
    tile_content::decode_content(kept.at(contents[i]), contents[i], own);
  });
}

void print(const Task& task, double floor_s) {
  const Cost& cost = task.best;
  const double reading_s = cost.wall_s - cost.scene_s;
  const double without_server_s = reading_s - cost.server_s / tbb::info::default_concurrency();
  std::printf("  %-28s %6.3f s  %6.3f CPU s  server %5.3f CPU s  %5.2f x decoding (%4.2f without the server)  %6.1f MB",
              task.name.c_str(), cost.wall_s, cost.processor_s, cost.server_s, reading_s / floor_s,
              without_server_s / floor_s, cost.memory_mb);
  std::printf(cost.scene_s > 0 ? "  scene %5.3f s\n" : "\n", cost.scene_s);
  std::fflush(stdout);
}

void compare(const fs::path& tileset, const SlowServer& server, bool textures, int runs) {
  KeepingSource keeping(tileset);
  tileset::LoadOptions options;
  options.textures = textures;
  const tileset::LoadedTiles all = tileset::load_region(keeping, tileset.string(), options);
  std::vector<std::string> contents;
  std::size_t bytes = 0;
  for (const auto& [uri, read] : keeping.kept()) {
    bytes += read.size();
    const std::string kind = tile_content::detect_content_format(read);
    if (kind == "b3dm" || kind == "glb" || kind == "i3dm" || kind == "pnts" || kind == "cmpt") contents.push_back(uri);
  }
  std::printf("%s, %s: %lld triangles, %lld tiles, %.1f MB\n", tileset.parent_path().filename().c_str(),
              textures ? "textures" : "geometry", static_cast<long long>(all.triangles),
              static_cast<long long>(all.tiles_loaded), 1e-6 * static_cast<double>(bytes));
  const std::string url = server.url(tileset.filename().string());
  const fs::path cache = fs::temp_directory_path() / ("tiles_benchmark_" + std::to_string(getpid()));
  const auto forget = [&] { fs::remove_all(cache); };
  std::vector<Task> tasks{{"decoding alone, from memory",
                           [&] {
                             decode(keeping.kept(), contents, textures);
                             return 0.0;
                           }},
                          {"disk, meshes alone", [&] { return read(tileset.string(), textures).complete ? 0.0 : 1.0; }},
                          {"disk", [&] { return load(tileset.string(), textures); }},
                          {"server, 20 ms, no cache", [&] { return load(url, textures); }},
                          {"server, 20 ms, cold cache", [&] { return load(url, textures, cache); }, forget},
                          {"server, 20 ms, warm cache", [&] { return load(url, textures, cache); }}};
  // In turns, so that a temporarily slow machine slows down the lower bound, too.
  for (int i = 0; i < runs; ++i)
    for (Task& task : tasks) task.run(server);
  for (const Task& task : tasks) print(task, tasks.front().best.wall_s);
  forget();
}

}  // namespace

int main(int argc, char** argv) {
  int runs = 3;
  std::vector<fs::path> tilesets;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--runs") == 0 && i + 1 < argc) {
      runs = std::stoi(argv[++i]);
    } else {
      tilesets.emplace_back(argv[i]);
    }
  }
  if (tilesets.empty()) {
    for (const char* name : {"machangara_photogrammetry", "paphos_agora_meshopt"}) {
      const fs::path tileset = tests::test_data_root() / "tilesets" / name / "tileset.json";
      if (fs::exists(tileset)) tilesets.push_back(tileset);
    }
  }
  if (tilesets.empty()) std::printf("no tilesets: name some, or set TILEFLIGHT_TEST_DATA\n");
  // Started before any threads, which a fork would not copy.
  std::vector<std::unique_ptr<SlowServer>> servers;
  for (const fs::path& tileset : tilesets) servers.push_back(std::make_unique<SlowServer>(tileset.parent_path()));
  for (std::size_t i = 0; i < tilesets.size(); ++i) {
    for (const bool textures : {false, true}) compare(tilesets[i], *servers[i], textures, runs);
  }
  return 0;
}
