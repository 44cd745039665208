// One participant of DDS: it says its name on a topic, or tells what it hears there. Security is what a folder of keys says.
//   dds_probe NAME ENCLAVE_FOLDER|- DOMAIN say|hear TOPIC SECONDS
// It prints "refused" if it may not take part, "denied" if it may not use the topic, else one line for each name heard.
#include <chrono>
#include <cstring>
#include <iostream>
#include <set>
#include <string>
#include <thread>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;
using Clock = std::chrono::steady_clock;

constexpr uint32_t kLongest = 64;

struct Word {
    char text[kLongest] = {};
};

class WordType : public TopicDataType {
public:
    WordType() {
        setName("Word");
        m_typeSize = sizeof(Word);
        m_isGetKeyDefined = false;
    }
    bool serialize(void* data, SerializedPayload_t* payload) override {
        std::memcpy(payload->data, data, sizeof(Word));
        payload->length = sizeof(Word);
        return true;
    }
    bool deserialize(SerializedPayload_t* payload, void* data) override {
        if (payload->length < sizeof(Word)) return false;
        std::memcpy(data, payload->data, sizeof(Word));
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void*) override {
        return [] { return static_cast<uint32_t>(sizeof(Word)); };
    }
    void* createData() override { return new Word; }
    void deleteData(void* data) override { delete static_cast<Word*>(data); }
    bool getKey(void*, InstanceHandle_t*, bool) override { return false; }
};

void secure(DomainParticipantQos& qos, const std::string& folder) {
    const std::string at = "file://" + folder + "/";
    auto& given = qos.properties().properties();
    given.emplace_back("dds.sec.auth.plugin", "builtin.PKI-DH");
    given.emplace_back("dds.sec.auth.builtin.PKI-DH.identity_ca", at + "identity_ca.cert.pem");
    given.emplace_back("dds.sec.auth.builtin.PKI-DH.identity_certificate", at + "cert.pem");
    given.emplace_back("dds.sec.auth.builtin.PKI-DH.private_key", at + "key.pem");
    given.emplace_back("dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC");
    given.emplace_back("dds.sec.access.plugin", "builtin.Access-Permissions");
    given.emplace_back("dds.sec.access.builtin.Access-Permissions.permissions_ca", at + "permissions_ca.cert.pem");
    given.emplace_back("dds.sec.access.builtin.Access-Permissions.governance", at + "governance.p7s");
    given.emplace_back("dds.sec.access.builtin.Access-Permissions.permissions", at + "permissions.p7s");
}

void speak(DomainParticipant* participant, Topic* topic, const std::string& name, Clock::time_point end) {
    auto* writer = participant->create_publisher(PUBLISHER_QOS_DEFAULT)->create_datawriter(topic, DATAWRITER_QOS_DEFAULT);
    if (!writer) {
        std::cout << "denied" << std::endl;
        return;
    }
    Word word;
    std::strncpy(word.text, name.c_str(), kLongest - 1);
    for (; Clock::now() < end; std::this_thread::sleep_for(std::chrono::milliseconds(50))) writer->write(&word);
}

void hear(DomainParticipant* participant, Topic* topic, Clock::time_point end) {
    auto* reader = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT)->create_datareader(topic, DATAREADER_QOS_DEFAULT);
    if (!reader) {
        std::cout << "denied" << std::endl;
        return;
    }
    std::set<std::string> heard;
    for (; Clock::now() < end; std::this_thread::sleep_for(std::chrono::milliseconds(20))) {
        Word word;
        SampleInfo info;
        while (reader->take_next_sample(&word, &info) == ReturnCode_t::RETCODE_OK) {
            if (info.valid_data && heard.insert(word.text).second) std::cout << word.text << std::endl;
        }
    }
}

int main(int count, char** given) {
    if (count != 7) return 2;
    const std::string name = given[1], folder = given[2], deed = given[4], topic_name = given[5];
    const auto end = Clock::now() + std::chrono::milliseconds(1000 * std::stoi(given[6]));
    DomainParticipantQos qos;
    auto loopback = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    loopback->interfaceWhiteList.push_back("127.0.0.1");
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(loopback);
    if (folder != "-") secure(qos, folder);
    auto* participant = DomainParticipantFactory::get_instance()->create_participant(std::stoi(given[3]), qos);
    if (!participant) return std::cout << "refused\n", 0;
    TypeSupport type(new WordType);
    type.register_type(participant);
    auto* topic = participant->create_topic(topic_name, type.get_type_name(), TOPIC_QOS_DEFAULT);
    if (deed == "say") {
        speak(participant, topic, name, end);
    } else {
        hear(participant, topic, end);
    }
    participant->delete_contained_entities();
    DomainParticipantFactory::get_instance()->delete_participant(participant);
    return 0;
}
