#include "source_options.h"

#include <cstdlib>
#include <filesystem>

namespace tileflight::app {
namespace {

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? std::string() : std::string(value);
}

/// XDG Base Directory Specification: a relative path is ignored. Empty if there is no home folder either.
std::filesystem::path users_cache() {
  const std::filesystem::path folder = environment("XDG_CACHE_HOME");
  if (folder.is_absolute()) return folder / "tileflight";
  const std::filesystem::path home = environment("HOME");
  return home.is_absolute() ? home / ".cache" / "tileflight" : std::filesystem::path();
}

}  // namespace

void add_source_options(CLI::App& command, SourceArguments& arguments) {
  const std::string group = "Sources from the network";
  command
      .add_option("--header", arguments.headers,
                  "HTTP header \"Name: value\" for each request to the tileset's own host (may be repeated)")
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option("--allow-host", arguments.allowed_hosts,
                  "additional host (or host:port) that the tileset may load from (may be repeated)")
      ->allow_extra_args(false)
      ->group(group);
  auto* cache = command
                    .add_option("--cache", arguments.cache,
                                "folder of the cache (default: $XDG_CACHE_HOME/tileflight or ~/.cache/tileflight)")
                    ->group(group);
  command.add_option("--cache-size", arguments.cache_gb, "maximum size of the cache, GB (default 4)")
      ->check(CLI::PositiveNumber)
      ->group(group);
  command.add_flag("--no-cache", arguments.no_cache, "do not cache on disk")->excludes(cache)->group(group);
  command
      .add_flag(
          "--terms-accepted", arguments.terms_accepted,
          "declare that your agreement with the provider allows what its public terms forbid (recorded in the result)")
      ->group(group);
}

fetch::SourceOptions source_options(const SourceArguments& arguments) {
  fetch::SourceOptions options;
  options.headers = arguments.headers;
  options.http.allowed_hosts = arguments.allowed_hosts;
  if (!arguments.no_cache)
    options.cache_folder = arguments.cache.empty() ? users_cache() : std::filesystem::path(arguments.cache);
  options.cache_required = !arguments.cache.empty();
  options.cache_max_bytes = static_cast<std::uintmax_t>(arguments.cache_gb * 1e9);
  options.terms_accepted = arguments.terms_accepted;
  options.google_key = environment("GOOGLE_MAPS_API_KEY");
  options.ion_token = environment("CESIUM_ION_TOKEN");
  const std::string region = environment("AWS_REGION");
  options.s3 = {.endpoint_url = environment("AWS_ENDPOINT_URL"),
                .region = region.empty() ? environment("AWS_DEFAULT_REGION") : region,
                .access_key_id = environment("AWS_ACCESS_KEY_ID"),
                .secret_access_key = environment("AWS_SECRET_ACCESS_KEY"),
                .session_token = environment("AWS_SESSION_TOKEN")};
  return options;
}

}  // namespace tileflight::app
