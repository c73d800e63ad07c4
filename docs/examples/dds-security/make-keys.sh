#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Files of DDS Security for the machines of one robot, or one fleet (docs/ros2.md, "Certificates").
#   make-keys.sh FOLDER DOMAIN MACHINE...
# FOLDER/ca keeps the authority: its key makes participants, so it stays off the robots. FOLDER/MACHINE is what that
# machine gets as dds.security. A later call with other machines uses the same authority.
set -eu
umask 077
[ $# -ge 3 ] || { echo "usage: make-keys.sh FOLDER DOMAIN MACHINE..." >&2; exit 64; }
folder=$1 domain=$2
shift 2
days=3650 # dates of permissions have no zone but UTC
not_before=$(date -u -d '1 day ago' +%Y-%m-%dT00:00:00) not_after=$(date -u -d "$days days" +%Y-%m-%dT00:00:00)
mkdir -p "$folder/ca"
ca=$folder/ca
if [ ! -e "$ca/key.pem" ]; then
  openssl ecparam -name prime256v1 -genkey -noout -out "$ca/key.pem"
  openssl req -x509 -new -key "$ca/key.pem" -sha256 -days $days -subj "/O=Takt/CN=authority" -out "$ca/cert.pem"
fi
sign() { openssl smime -sign -text -in "$1" -out "$2" -signer "$ca/cert.pem" -inkey "$ca/key.pem"; }

# Everything between participants is encrypted, discovery included, and none joins without permissions.
cat > "$ca/governance.xml" <<XML
<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
     xsi:noNamespaceSchemaLocation="http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_governance.xsd">
  <domain_access_rules>
    <domain_rule>
      <domains><id>$domain</id></domains>
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
      <rtps_protection_kind>ENCRYPT</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>true</enable_discovery_protection>
          <enable_liveliness_protection>true</enable_liveliness_protection>
          <enable_read_access_control>true</enable_read_access_control>
          <enable_write_access_control>true</enable_write_access_control>
          <metadata_protection_kind>NONE</metadata_protection_kind>
          <data_protection_kind>NONE</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
XML
sign "$ca/governance.xml" "$ca/governance.p7s"

for machine in "$@"; do
  of=$folder/$machine
  mkdir -p "$of"
  openssl ecparam -name prime256v1 -genkey -noout -out "$of/key.pem"
  openssl req -new -key "$of/key.pem" -subj "/O=Takt/CN=$machine" -out "$of/request.pem"
  openssl x509 -req -in "$of/request.pem" -CA "$ca/cert.pem" -CAkey "$ca/key.pem" -CAcreateserial -sha256 -days $days \
    -out "$of/cert.pem" 2> /dev/null
  cat > "$of/permissions.xml" <<XML
<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
     xsi:noNamespaceSchemaLocation="http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_permissions.xsd">
  <permissions>
    <grant name="$machine">
      <subject_name>CN=$machine,O=Takt</subject_name>
      <validity><not_before>$not_before</not_before><not_after>$not_after</not_after></validity>
      <allow_rule>
        <domains><id>$domain</id></domains>
        <publish><topics><topic>*</topic></topics><partitions><partition>*</partition></partitions></publish>
        <subscribe><topics><topic>*</topic></topics><partitions><partition>*</partition></partitions></subscribe>
      </allow_rule>
      <default>DENY</default>
    </grant>
  </permissions>
</dds>
XML
  sign "$of/permissions.xml" "$of/permissions.p7s"
  cp "$ca/governance.p7s" "$of/"
  cp "$ca/cert.pem" "$of/identity_ca.cert.pem"
  cp "$ca/cert.pem" "$of/permissions_ca.cert.pem"
  rm "$of/request.pem" "$of/permissions.xml"
done
