#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "tileflight/tiles/fetch/http_provider.h"
#include "tileflight/tiles/fetch/provider_google.h"

namespace tileflight::fetch {

/// Access to an asset of Cesium ion.
struct IonOptions {
  std::string api = "https://api.cesium.com";
  std::string asset;  ///< number of the asset
  std::string token;
  GoogleOptions google;  ///< for assets that are Google's tiles; its key and root come from ion
};

/// Serves an asset of Cesium ion (REST API, "Assets: access tiles"). The user's token is exchanged for an endpoint: a
/// URL and an access token for the asset, which each request of that origin carries as a bearer token. The access token
/// expires after an hour; a 401 response triggers a renewal, once per request. An external asset ("externalType": its
/// tiles are hosted elsewhere) is requested at the URL that the endpoint names, with that URL's parameters; Google's
/// tiles keep Google's protocol and terms.
class IonProvider : public HttpProvider {
 public:
  /// Throws InputError if there is no token or no asset number.
  explicit IonProvider(const IonOptions& options);

  std::string resolve_root_url(HttpClient& client) override;
  HttpRequest make_request(const std::string& uri) override;
  void observe_response(const std::string& uri, std::span<const std::byte> body) override;
  void refresh_credentials(HttpClient& client) override;
  bool renew_credentials(HttpClient& client, long status, int generation) override;
  int credential_generation() const override;
  std::vector<std::string> secrets() const override;
  std::vector<std::string> attribution() const override;
  TermsOfUse terms() const override;

 private:
  struct Endpoint {
    std::string url;
    std::string access_token;  ///< empty: the asset is external
    std::vector<std::string> attribution;
  };

  Endpoint get_endpoint(HttpClient& client) const;

  IonOptions options_;
  std::unique_ptr<HttpProvider> external_;  ///< serves an external asset; set by `resolve_root_url`
  std::string name_;                        ///< for messages
  std::vector<std::string> attribution_;
  std::mutex renewing_;                     ///< one endpoint request at a time
  mutable std::mutex mutex_;                ///< guards the members below
  std::vector<std::string> access_tokens_;  ///< all so far; the last one is in use
};

/// Returns the plain text of an attribution's HTML, or the title if it is an image.
std::string html_to_text(const std::string& html);

}  // namespace tileflight::fetch
