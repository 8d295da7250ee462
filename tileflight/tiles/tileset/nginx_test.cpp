#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/tiles/fetch/http_source.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/test_http_tileset.h"

/// End to end over the loopback device against a real nginx: HTTP/2 over TLS, gzip, validators. Skipped if nginx or
/// openssl is not installed.
namespace tileflight::tileset::nginx_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::string text_of_file(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

fs::path program(const std::string& name) {
  for (const char* folder : {"/usr/sbin", "/usr/bin", "/usr/local/sbin", "/usr/local/bin"}) {
    if (fs::exists(fs::path(folder) / name)) return fs::path(folder) / name;
  }
  return {};
}

/// A port that was free just before.
int free_port() {
  return fetch::test_support::TestHttpServer(
             [](const fetch::test_support::ServedRequest&, fetch::test_support::ServedConnection&) { return false; })
      .port();
}

/// nginx in the foreground with its own configuration in a temporary folder.
class Nginx {
 public:
  explicit Nginx(const fs::path& served) : port_(free_port()) {
    make_certificate();
    write_configuration(served);
    child_ = fork();
    if (child_ == 0) {
      const std::string folder = folder_.path().string() + "/";
      const std::string configuration = (folder_ / "nginx.conf").string();
      const std::string log = (folder_ / "error.log").string();
      execl(program("nginx").c_str(), "nginx", "-p", folder.c_str(), "-c", configuration.c_str(), "-e", log.c_str(),
            static_cast<char*>(nullptr));
      _exit(127);
    }
  }
  Nginx(const Nginx&) = delete;
  Nginx& operator=(const Nginx&) = delete;
  ~Nginx() {
    kill(child_, SIGTERM);
    waitpid(child_, nullptr, 0);
  }

  std::string url(const std::string& path) const { return "https://localhost:" + std::to_string(port_) + "/" + path; }
  fs::path certificate() const { return folder_ / "certificate.pem"; }
  std::string access_log() const { return text_of_file(folder_ / "access.log"); }
  std::string error_log() const { return text_of_file(folder_ / "error.log"); }

 private:
  void make_certificate() const {
    const std::string command = program("openssl").string() + " req -x509 -newkey rsa:2048 -nodes -days 2" +
                                " -subj /CN=localhost -addext subjectAltName=DNS:localhost -keyout " +
                                (folder_ / "key.pem").string() + " -out " + certificate().string() + " 2> /dev/null";
    if (std::system(command.c_str()) != 0) throw std::runtime_error("openssl makes no certificate");
  }

  void write_configuration(const fs::path& served) const {
    std::ofstream(folder_ / "nginx.conf")
        << "daemon off; master_process off; pid nginx.pid; worker_processes 1;\n"
        << "events { worker_connections 64; }\n"
        << "http {\n"
        << "  log_format short '$status $server_protocol $connection $uri $gzip_ratio';\n"
        << "  access_log access.log short;\n"
        << "  client_body_temp_path body; proxy_temp_path proxy; fastcgi_temp_path fastcgi; uwsgi_temp_path uwsgi;\n"
        << "  scgi_temp_path scgi; gzip on; gzip_types application/json; gzip_min_length 10;\n"
        << "  types { application/json json; model/gltf-binary glb; application/octet-stream b3dm; }\n"
        << "  server { listen 127.0.0.1:" << port_ << " ssl http2; server_name localhost;\n"
        << "    ssl_certificate certificate.pem; ssl_certificate_key key.pem; add_header Cache-Control no-cache;\n"
        << "    root " << served.string() << ";\n"
        << "    location /moved/ { return 301 /$arg_to; } }\n"
        << "}\n";
  }

  tests::TemporaryFolder folder_;
  int port_;
  pid_t child_ = -1;
};

class NginxTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_FALSE(program("nginx").empty() || program("openssl").empty()) << "missing; .ci/set-up installs both";
  }

  fetch::SourceOptions options(const Nginx& nginx) const {
    fetch::SourceOptions options;
    options.http = test_support::quick_source_options();
    options.http.http.retry.max_tries = 20;  // until it listens
    options.http.http.retry.max_backoff = std::chrono::milliseconds(200);
    options.http.http.ca_file = nginx.certificate();
    return options;
  }

  static int count(const std::string& text, const std::string& part) {
    int count = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
    return count;
  }
};

TEST_F(NginxTest, ATilesetOverHttp2AndAgainFromTheCache) {
  test_support::TestHttpTileset place;
  place.add_tileset();
  const tests::TemporaryFolder served;
  const tests::TemporaryFolder cache;
  for (const auto& [path, content] : place.files()) {
    const fs::path file = served.path().string() + path;
    fs::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << content;
  }
  const Nginx nginx(served.path());
  LoadOptions load;
  load.source = options(nginx);
  load.source.cache_folder = cache.path();

  const LoadedTiles first = load_region(nginx.url("place/tileset.json"), load);
  EXPECT_EQ(first.tiles_loaded, 2) << nginx.error_log();
  EXPECT_EQ(first.triangles, 2);
  const std::string log = nginx.access_log();
  EXPECT_EQ(count(log, "200 HTTP/2.0"), 4) << log;
  EXPECT_THAT(log, ::testing::ContainsRegex("tileset.json [1-9]")) << "packed";

  const LoadedTiles again = load_region(nginx.url("place/tileset.json"), load);
  EXPECT_EQ(again.cut_hash, first.cut_hash);
  EXPECT_EQ(again.bytes_read, first.bytes_read);
  EXPECT_EQ(count(nginx.access_log(), "304 HTTP/2.0"), 4) << "asked about, not sent again";

  load.source.http.http.ca_file.clear();
  load.source.cache_folder.clear();
  load.source.http.http.retry.max_tries = 1;
  EXPECT_THAT(base::test_support::error_of([&] { load_region(nginx.url("place/tileset.json"), load); }),
              HasSubstr("certificate"))
      << "a certificate that nobody vouches for is no server";
}

TEST_F(NginxTest, ARealPlaceIsTheSameAsFromItsFolder) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/paphos_agora_meshopt");
  const Nginx nginx(fs::canonical(folder));
  LoadOptions load;
  const LoadedTiles expected = load_region(folder.string(), load);
  load.source = options(nginx);
  const LoadedTiles tiles = load_region(nginx.url("tileset.json"), load);
  EXPECT_TRUE(tiles.complete);
  EXPECT_EQ(tiles.cut_hash, expected.cut_hash);
  EXPECT_EQ(tiles.bytes_read, expected.bytes_read);
  EXPECT_EQ(tiles.triangles, expected.triangles);
}

}  // namespace
}  // namespace tileflight::tileset::nginx_test
