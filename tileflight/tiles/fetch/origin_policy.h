#pragma once

#include <string>
#include <vector>

namespace tileflight::fetch {

/// Scheme, host and port of an http or https URL, parsed by libcurl, so that the checked origin is the one contacted.
struct Origin {
  std::string scheme;  ///< "http" or "https"
  std::string host;    ///< lower case
  std::string port;    ///< the scheme's default port if the URL has none

  bool operator==(const Origin&) const = default;
};

/// Parses the origin of a URL. Throws InputError if it is not a URL, has another scheme or has a user name.
Origin parse_origin(const std::string& url);

/// Decides which URLs a network tileset may refer to: its own origin (also over https if it came over http), and hosts
/// allowed by the user. It never allows http from https, nor a file.
class OriginPolicy {
 public:
  /// `allowed_hosts`: "host", or "host:port" for that port only. Throws InputError if `root_url` is not a URL.
  OriginPolicy(const std::string& root_url, std::vector<std::string> allowed_hosts = {});

  /// Throws InputError, naming the URL and the violation, if the URL is not allowed.
  void check(const std::string& url) const;
  /// Returns whether a URL is of the tileset's own origin: only that origin receives the user's headers and
  /// credentials.
  bool is_same_origin(const std::string& url) const;

 private:
  Origin own_;
  std::vector<std::string> allowed_hosts_;
};

}  // namespace tileflight::fetch
