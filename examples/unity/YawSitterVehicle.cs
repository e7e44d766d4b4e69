// Shows a YawSitter in Unity: put it on a GameObject whose model has its nose along +z, its back along +y and its right
// wing along +x. Written after the sources of eclipse-zenoh/zenoh-csharp (the package Zenoh, which needs the native
// library zenoh-c beside it). NOT RUN by this project's tests: there is no Unity there.
//
// What comes over Zenoh (docs/telemetry.md has all of it; JSON, one object a message, further fields may be there):
//   yawsitter/<instance>/state      now_us            simulation time, microseconds
//                                   position_N_m      [north, east, down] of the start, metres
//                                   wind_N_m_s        [north, east, down] in which the air moves
//   yawsitter/<instance>/attitude   now_us
//                                   q_NB              [w, x, y, z]: forward-right-down of the aeroplane to
//                                                     north-east-down; standing on its tail the nose points up
//   yawsitter/<instance>/actuators  now_us
//                                   rotor_left_rpm, rotor_right_rpm
//                                   flap_left_deg, flap_right_deg
// All three of one instant have the same now_us.
//
// Frames. Unity is left-handed: x right, y up, z forward. With x = east, y = up, z = north the compass stays as it is,
// and with the same exchange in the body (x right wing, y back, z nose) a rotation keeps its angle; its axis (x, y, z)
// becomes (y, -z, x), and turning the other way round in a left-handed frame changes the sign of all three.

using System.Collections.Concurrent;
using UnityEngine;
using Zenoh;

public class YawSitterVehicle : MonoBehaviour
{
    [System.Serializable] private class State { public long now_us; public float[] position_N_m; }
    [System.Serializable] private class Attitude { public long now_us; public float[] q_NB; }
    [System.Serializable]
    private class Actuators
    {
        public long now_us;
        public float rotor_left_rpm, rotor_right_rpm, flap_left_deg, flap_right_deg;
    }

    public string endpoint = "tcp/127.0.0.1:7447"; // of instance i: 7447 + i
    public int instance = 0;
    public Transform leftPropeller, rightPropeller, leftFlap, rightFlap; // each turns about its own axis; may be empty

    private readonly ConcurrentDictionary<string, string> newest = new ConcurrentDictionary<string, string>();
    private readonly SubscriberCallback hear;
    private Session session;
    private Subscriber subscriber;

    public YawSitterVehicle()
    {
        hear = sample => newest[sample.Key] = sample.ValueToString(); // on Zenoh's thread: nothing of Unity in here
    }

    private void OnEnable()
    {
        var config = new Config();
        config.SetConnect(new[] { endpoint });
        session = new Session();
        if (!session.Open(config))
        {
            Debug.LogError($"nobody answers at {endpoint}: start a vehicle with `sitl run`");
            enabled = false;
            return;
        }
        subscriber = new Subscriber($"yawsitter/{instance}/*", hear);
        session.RegisterSubscriber(subscriber);
    }

    private void OnDisable() => session?.Close();

    private void Update()
    {
        if (newest.TryGetValue($"yawsitter/{instance}/state", out var state))
        {
            var p = JsonUtility.FromJson<State>(state).position_N_m;
            transform.position = new Vector3(p[1], -p[2], p[0]);
        }
        if (newest.TryGetValue($"yawsitter/{instance}/attitude", out var attitude))
        {
            var q = JsonUtility.FromJson<Attitude>(attitude).q_NB;
            transform.rotation = new Quaternion(-q[2], q[3], -q[1], q[0]);
        }
        if (newest.TryGetValue($"yawsitter/{instance}/actuators", out var text))
        {
            var a = JsonUtility.FromJson<Actuators>(text);
            Spin(leftPropeller, a.rotor_left_rpm);
            Spin(rightPropeller, -a.rotor_right_rpm);
            if (leftFlap) leftFlap.localRotation = Quaternion.Euler(-a.flap_left_deg, 0f, 0f);
            if (rightFlap) rightFlap.localRotation = Quaternion.Euler(-a.flap_right_deg, 0f, 0f);
        }
    }

    private static void Spin(Transform propeller, float rpm)
    {
        if (propeller) propeller.Rotate(0f, 0f, 6f * rpm * Time.deltaTime, Space.Self);
    }
}
